"use strict";

const SPEEDS = [1, 2, 5, 10, 20]; // episodes per second

/** Connects the buttons, the switches, the choices and the pointers with a lesson. */
class LessonControls {
  constructor(lesson, view, redraw) {
    Object.assign(this, { lesson, view, redraw });
    this.#fillChoices();
    this.#listen();
    for (let i = 0; i < 2; i++) this.#listenToMap(element(`learned-map-${i}`), i);
  }

  #spoken = null; // the state that the status line has told

  /** Shows the choices and the state of the lesson. */
  update() {
    const { lesson } = this;
    const { faults, seed, units, speed, hasControls, unknown } = lesson.choices;
    element("choices").hidden = !hasControls;
    for (const box of document.querySelectorAll("#faults input")) box.checked = faults.includes(box.value);
    element("seed").value = seed;
    choice(element("speed"), speed, `${speed} episodes a second`);
    choice(element("network-size"), units.join("-"), units.join("-"));
    const started = lesson.episode > 0;
    element("train").firstElementChild.textContent = lesson.running ? "Pause" : started ? "Go on" : "Start";
    element("train").disabled = element("one-episode").disabled = lesson.isFinished || Boolean(lesson.problem);
    element("fault-text").textContent = this.#faultText(faults);
    const text = unknown.length
      ? `This page knows no fault ${unknown.join(", ")}.`
      : lesson.problem || this.#stateText();
    // Written only when it changes, because screen readers tell each change.
    if (text !== this.#spoken) element("learning-status").textContent = this.#spoken = text;
  }

  #faultText(faults) {
    const { switches } = this.lesson.recorded.learning;
    const sentences = switches.filter(({ name }) => faults.includes(name)).map(({ sentence }) => sentence);
    return sentences.join(" ") || "Switch a fault on: a run with it learns beside the healthy one, from the same seed.";
  }

  #stateText() {
    const { lesson } = this;
    if (lesson.running) return "Learning.";
    if (!lesson.episode) return "";
    if (!lesson.isFinished) return `Paused.`;
    const [healthy, faulty] = lesson.runs.map(({ regrets }) => shown(regrets.at(-1).regret, 1));
    return `Finished: greedy regret ${healthy}${faulty ? `, with the fault ${faulty}` : ""}.`;
  }

  #fillChoices() {
    const { switches, networks, settings } = this.lesson.recorded.learning;
    for (const { name, title, sentence } of switches) {
      const label = document.createElement("label");
      const box = Object.assign(document.createElement("input"), { type: "checkbox", value: name });
      label.title = box.title = sentence; // that of the box is its description for screen readers
      label.append(box, title);
      element("faults").append(label);
    }
    element("speed").append(
      option(0, "as fast as it can"),
      ...SPEEDS.map((each) => option(each, `${each} episode${each > 1 ? "s" : ""} a second`)),
    );
    const sizes = [settings.hidden_units, ...networks].map((each) => each.join("-"));
    element("network-size").append(...sizes.map((size) => option(size, size)));
  }

  /** Writes the time of a whole run behind each size, from the speed of one. */
  showTimes(seconds) {
    for (const each of element("network-size").options) {
      const time = seconds(each.value.split("-").map(Number));
      each.textContent = `${each.value}, about ${time < 90 ? `${Math.ceil(time)} s` : `${Math.ceil(time / 60)} min`}`;
    }
  }

  #listen() {
    const { lesson } = this;
    const choose = (changes) => {
      const { running } = lesson;
      lesson.choose({ ...changes, unknown: [] });
      writeAddress(lesson.choices, lesson.recorded.learning);
      if (running) lesson.run(true);
    };
    element("train").addEventListener("click", () => lesson.run(!lesson.running));
    element("one-episode").addEventListener("click", () => lesson.step());
    element("another-seed").addEventListener("click", () => choose({ seed: lesson.choices.seed + 1 }));
    element("again").addEventListener("click", () => choose({}));
    element("seed").addEventListener("change", ({ target }) => {
      const seed = Math.floor(Number(target.value));
      choose({ seed: Math.min(Math.max(seed || 0, 0), 2 ** 32 - 1) });
    });
    element("network-size").addEventListener("change", ({ target }) => {
      choose({ units: target.value.split("-").map(Number) });
    });
    element("speed").addEventListener("change", ({ target }) => {
      lesson.choices.speed = Number(target.value);
      writeAddress(lesson.choices, lesson.recorded.learning);
    });
    element("faults").addEventListener("change", () => {
      const boxes = [...document.querySelectorAll("#faults input:checked")];
      choose({ faults: boxes.map(({ value }) => value) });
    });
    element("sweep").addEventListener("click", () => lesson.toggleSweeps());
    for (const button of document.querySelectorAll("[data-learned-layer]")) {
      button.addEventListener("click", () => this.showLayer(button.dataset.learnedLayer));
    }
  }

  showLayer(layer) {
    this.view.layer = layer;
    for (const button of document.querySelectorAll("[data-learned-layer]")) {
      button.setAttribute("aria-pressed", button.dataset.learnedLayer === layer);
    }
    this.redraw();
  }

  /** A pointer, or the arrow keys, choose the cell whose backup is shown. */
  #listenToMap(canvas, index) {
    const { view } = this;
    const choose = (row, column) => {
      const last = LEARNED_MAP_SIZE - 1;
      view.chosen = index;
      view.cell = [row, column].map((each) => Math.min(Math.max(each, 0), last));
      this.redraw();
    };
    const point = (event) => {
      if (event.type === "pointermove" && event.pointerType !== "mouse" && !event.buttons) return;
      element("backup-text").setAttribute("aria-live", "off");
      const place = pointedPlace(canvas, event);
      const [column, row] = place.map((share) => Math.round(share * (LEARNED_MAP_SIZE - 1)));
      choose(row, column);
    };
    canvas.addEventListener("pointerdown", point);
    canvas.addEventListener("pointermove", point);
    canvas.addEventListener("keydown", (event) => {
      const move = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] }[event.key];
      if (!move) return;
      event.preventDefault();
      const step = event.shiftKey ? 1 : 3;
      // While it learns, the numbers change by themselves: a screen reader would tell each change.
      element("backup-text").setAttribute("aria-live", this.lesson.running ? "off" : "polite");
      const [row, column] = view.chosen === index ? view.cell : [24, 24];
      choose(row + step * move[0], column + step * move[1]);
    });
  }
}

function option(value, text) {
  return Object.assign(document.createElement("option"), { value, textContent: text });
}

/** Chooses a value of a list, which gets it where the address names another one. */
function choice(list, value, text) {
  const values = [...list.options].map((each) => each.value);
  if (!values.includes(String(value))) list.append(option(value, text));
  list.value = value;
}
