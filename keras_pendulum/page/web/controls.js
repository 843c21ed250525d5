"use strict";

const DIRECTION_OF_KEY = { j: -1, k: 0, l: 1 }; // of your effort
// To the right and up: of your effort, and of a move on the phase portrait.
const ARROWS = { arrowleft: [-1, 0], arrowright: [1, 0], arrowup: [0, 1], arrowdown: [0, -1] };
const ONCE = [" ", "m", "h", "r", "t", "p"]; // keys that act once when they are held

/** Connects buttons, keys, pointers and preferences to the page. */
class Controls {
  constructor(page) {
    this.page = page;
    this.#listenToButtons();
    this.#listenToPointers();
    addEventListener("keydown", (event) => this.#key(event));
    element("portrait").addEventListener("blur", () => page.letGo());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      page.view.recolour();
      page.redraw();
    });
    calm.addEventListener("change", () => page.pause(!calm.matches));
    const sizes = new ResizeObserver(() => page.redraw());
    document.querySelectorAll("canvas").forEach((canvas) => sizes.observe(canvas));
  }

  /** Shows the state of the page in the buttons and the status line. */
  update() {
    const { episode, names, running } = this.page;
    const { youDrive, yourEffort } = episode;
    element("take-over").setAttribute("aria-checked", youDrive);
    for (const button of document.querySelectorAll("[data-direction]")) {
      const pressed = youDrive && Number(button.dataset.direction) === Math.sign(yourEffort);
      button.setAttribute("aria-pressed", pressed);
    }
    element("pause").firstElementChild.textContent = running ? "Pause" : "Play";
    element("name-0").textContent = youDrive ? "you" : names[0];
    element("name-0").toggleAttribute("data-you", youDrive);
    element("status").textContent = statusText(this.page);
  }

  #listenToButtons() {
    const { page } = this;
    const click = (button, act) =>
      button.addEventListener("click", (event) => {
        act();
        // After a click, Space pauses again instead of pressing this button.
        if (event.detail) button.blur();
      });
    click(element("take-over"), () => page.drive(!page.episode.youDrive));
    click(element("pause"), () => page.pause());
    click(element("one-step"), () => page.oneStep());
    click(element("restart"), () => page.restartAnew());
    const { hanging } = page.task;
    element("hang").hidden = !hanging;
    click(element("hang"), () => page.restartAnew(...hanging));
    click(element("play-training"), () => page.playTraining());
    for (const button of document.querySelectorAll("[data-direction]")) {
      const act = () => page.choose(Number(button.dataset.direction));
      button.addEventListener("pointerdown", act); // when the finger touches, not when it leaves
      click(button, act);
    }
    for (const button of document.querySelectorAll("[data-layer]")) {
      click(button, () => page.showLayer(Number(button.dataset.layer)));
    }
  }

  #listenToPointers() {
    const { page } = this;
    const touch = new Touch(page);
    touch.listenToSystem(element("system"), page.episode);
    if (page.other) touch.listenToSystem(element("system-1"), page.other);
    touch.listenToPortrait(element("portrait"));
  }

  #key(event) {
    const { page } = this;
    if (element("watch").hidden || event.ctrlKey || event.metaKey || event.altKey) return;
    const key = event.key.toLowerCase();
    const { id, localName } = event.target;
    const upOrDown = key === "arrowup" || key === "arrowdown";
    if (localName === "input" && (ARROWS[key] || key === " ")) return; // the slider's own keys
    if (localName === "button" && key === " ") return; // presses the button
    if (event.repeat && ONCE.includes(key)) return event.preventDefault(); // Space would scroll
    if (id === "portrait" && ARROWS[key]) this.#nudge(ARROWS[key], event.shiftKey);
    else if (page.heldByKey && (key === "enter" || key === " ")) page.letGo();
    else if (key in DIRECTION_OF_KEY) page.choose(DIRECTION_OF_KEY[key]);
    else if (ARROWS[key]?.[0]) page.choose(ARROWS[key][0] * page.task.rightward);
    // Up and down scroll the page unless you drive.
    else if (upOrDown && page.episode.youDrive) page.choose(0);
    else if (key === " ") page.pause();
    else if (key === "s") page.oneStep();
    else if (key === "m") page.showLayer(page.nextLayer());
    else if (key === "h" && page.task.hanging) page.restartAnew(...page.task.hanging);
    else if (key === "r") page.restartAnew();
    else if (key === "t") page.drive(!page.episode.youDrive);
    else if (key === "p") page.playTraining();
    else return;
    event.preventDefault();
  }

  /** Moves θ and θ̇ by a step of the keyboard and holds the system there. */
  #nudge(direction, fine) {
    const { page } = this;
    const { task } = page;
    const [theta, thetadot] = page.episode.state.slice(-2);
    const [angle, speed] = [task.angle(theta), thetadot].map((value, i) => {
      if (!direction[i]) return value;
      const step = (fine ? task.fineNudges : task.nudges)[i];
      const sign = i ? 1 : task.rightward;
      return (Math.round(value / step) + sign * direction[i]) * step;
    });
    page.putOnPortrait(task.angle(angle), speed, false, true);
  }
}
