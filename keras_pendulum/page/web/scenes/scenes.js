"use strict";

/** The scenes of the lesson: one text at a time, and the page below in the state that it speaks of. */
class Scenes {
  constructor(page) {
    this.articles = [...document.querySelectorAll("#scenes article")];
    const watch = (act) => () => {
      element("tab-watch").click();
      page.pause(!calm.matches);
      act();
    };
    const learn = (address) => () => {
      if (location.hash === `#${address}`) dispatchEvent(new HashChangeEvent("hashchange"));
      location.hash = address;
    };
    this.acts = [
      watch(() => {
        page.restart(...page.task.hanging);
        page.drive(true);
      }),
      watch(() => {
        page.drive(false);
        page.restart(...page.task.hanging);
        page.showLayer(1);
      }),
      learn("learn&seed=1"),
      learn("fault=one-update&seed=1"),
      watch(() => {
        page.drive(false);
        page.restart();
        page.showLayer(2);
      }),
    ];
    element("scene-back").addEventListener("click", () => this.show(this.shown - 1, true));
    element("scene-next").addEventListener("click", () => this.show(this.shown + 1, true));
    this.show(0);
  }

  /** Shows a scene; `focused` puts the focus on its title. */
  show(index, focused = false) {
    this.shown = index;
    this.articles.forEach((article, i) => {
      article.hidden = i !== index;
      article.toggleAttribute("data-shown", i === index);
    });
    const [before, after] = [this.articles[index - 1], this.articles[index + 1]];
    element("scene-back").hidden = !before;
    element("scene-next").hidden = !after;
    if (after) {
      element("scene-next").firstElementChild.textContent = after.querySelector("h2").textContent;
    }
    this.acts[index]();
    if (!focused) return;
    this.articles[index].querySelector("h2").focus();
    scrollTo(0, 0);
  }
}
