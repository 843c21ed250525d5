"use strict";

/** The tab bar: one of the two parts of the page is shown. */
class Tabs {
  /** `changed` is called with the name of the part that is shown: `watch` or `learn`. */
  constructor(changed) {
    this.changed = changed;
    this.buttons = [...document.querySelectorAll("[role=tab]")];
    this.buttons.forEach((button, i) => {
      button.addEventListener("click", () => this.show(button.dataset.tab));
      button.addEventListener("keydown", (event) => this.#key(event, i));
    });
  }

  show(name) {
    for (const button of this.buttons) {
      const isShown = button.dataset.tab === name;
      button.setAttribute("aria-selected", isShown);
      button.tabIndex = isShown ? 0 : -1;
      element(button.dataset.tab).hidden = !isShown;
    }
    document.querySelector("footer").hidden = name !== "watch";
    this.changed(name);
  }

  #key(event, i) {
    const last = this.buttons.length - 1;
    const next = { ArrowLeft: i ? i - 1 : last, ArrowRight: i < last ? i + 1 : 0, Home: 0, End: last }[event.key];
    if (next === undefined) return;
    event.preventDefault();
    event.stopPropagation(); // the arrow keys drive the pendulum elsewhere
    this.buttons[next].focus();
    this.show(this.buttons[next].dataset.tab);
  }
}
