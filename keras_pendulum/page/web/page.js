"use strict";

const element = (id) => document.getElementById(id);
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const REST = 3; // s between two episodes

/** The state of the page and its time. */
class Page {
  /**
   * @param {object} recorded the content of the page, see build.py.
   * @param {Task} task
   * @param {Network[]} networks one or two; the second is driven from the same starts, in step.
   * @param {Optimum} optimum
   * @param {?Training} training the networks that the slider shows in place of the first one.
   */
  constructor(recorded, task, networks, optimum, training) {
    this.recorded = recorded;
    this.task = task;
    this.optimum = optimum;
    this.training = training;
    this.episodes = networks.map((each) => new Episode(each, task));
    [this.episode, this.other] = this.episodes;
    this.maps = [networks[0], networks[1], optimum].map((each) => each && new PolicyMap(each, task));
    this.layer = 0;
    this.held = false; // whether a pointer or a key holds the system
    this.heldByKey = false;
    this.names = networkNames(recorded);
    this.firstScore = element("score").textContent;
    this.showNames();
    this.restart();
    this.running = !calm.matches;
    this.waiting = 0; // s since the last step
    this.changed = true; // whether anything but `waiting` has changed since the last frame
    this.view = new View(this);
    this.controls = new Controls(this);
    this.controls.update();
    this.exact = null; // for the γ of the network
    this.#findExact();
    this.training?.listen((network, map) => this.replaceNetwork(network, map));
    requestAnimationFrame((now) => this.frame(now, now));
  }

  /** Computes the exact Q-values beside the page; where it cannot, they are not shown. */
  async #findExact() {
    const { recorded, optimum } = this;
    this.exact = await optimum.exactValues(recorded, recorded.discount).catch(() => null);
    element("exact-key").hidden = !this.exact;
    this.redraw();
  }

  /** Takes the steps that are due and draws. */
  frame(now, before) {
    const { stepTime } = this;
    requestAnimationFrame((later) => this.frame(later, now));
    if (element("watch").hidden) return;
    const seconds = (now - before) / 1000;
    this.training?.advance(seconds);
    if (this.running && !this.held) {
      // Limited, so that a tab that was hidden does not rush through the missed steps.
      this.waiting = Math.min(this.waiting + seconds, 4 * stepTime);
      if (this.over) {
        this.resting += seconds; // time to read the score
        this.waiting = this.resting < REST ? 0 : stepTime;
      }
      for (; this.waiting >= stepTime; this.waiting -= stepTime) this.step();
    }
    if (this.changed || (this.running && !calm.matches)) this.view.drawSwing();
    this.map.aim(this.episode.state.slice(0, -2));
    if (this.map.work(8)) this.changeMap();
    if (this.changed) this.view.drawRest();
    this.training?.drawIfChanged(this.view.colours);
    this.changed = false;
  }

  /** Whether all episodes are over: one may be shorter than the other. */
  get over() {
    return this.episodes.every(({ over }) => over);
  }

  /** The duration of a step on the clock, in s. */
  get stepTime() {
    return this.episode.youDrive ? this.task.drivenStep : this.task.timeStep;
  }

  /** Takes the next time step; after the last one, starts a new episode. */
  step() {
    if (this.over) this.restart();
    else {
      this.episodes.forEach((episode) => episode.over || episode.step());
      if (this.over) this.showScore();
    }
    this.changed = true;
  }

  /** Starts an episode, with both networks from the same start. */
  restart(...state) {
    this.episode.reset(...state);
    this.start = this.episode.path[0];
    this.other?.reset(...this.start);
    this.optimalReturn = null;
    this.waiting = this.resting = 0;
    this.changed = true;
  }

  /** Starts an episode that the user asks for: the last score is no longer of interest. */
  restartAnew(...state) {
    element("score").textContent = this.firstScore;
    this.restart(...state);
  }

  /** Shows another network in place of the first one, from the same start. */
  replaceNetwork(network, map) {
    this.episode.network = network;
    this.maps[0] = map;
    this.changeMap();
    const { optimalReturn } = this;
    this.restartAnew(...this.start);
    this.optimalReturn = optimalReturn;
  }

  /** Shows the returns of the finished episode, of the network too if you drove, and the optimum. */
  showScore() {
    const { episode, task, other, names, start } = this;
    const youDrove = episode.drivers.has("you");
    const helped = youDrove && episode.drivers.has("network");
    const driver = helped ? `you and ${names[0]}` : youDrove ? "you" : names[0];
    const parts = [[driver, episode.return]];
    if (youDrove) {
      const policy = (state) => episode.network.effort(state);
      parts.push([names[0], simulatedReturn(task, start, task.episodeSteps, policy)]);
    }
    if (other) parts.push([names[1], other.return]);
    const optimal = this.optimalReturn ?? this.optimum.returnFrom(start);
    this.optimalReturn = Math.max(optimal, ...parts.map(([, total]) => total));
    parts.push(["optimum", this.optimalReturn]);
    const texts = parts.map(([name, total]) => `${name} ${shown(total, task.returnDigits)}`);
    element("score").textContent = `Score: ${texts.join(" · ")}`;
  }

  /** Labels the systems and the layers of the map. */
  showNames() {
    const { names, recorded } = this;
    if (!this.other) return;
    element("other").hidden = false;
    document.querySelector("figcaption").hidden = false;
    names.forEach((name, i) => {
      const { colour } = i ? recorded.against : recorded;
      element(`name-${i}`).style.setProperty("--preset", colour ?? "transparent");
      if (i) element(`name-${i}`).textContent = name;
      else element("values-title").textContent = `Q-values of ${name}`;
      const button = document.querySelector(`[data-layer="${i}"]`);
      button.hidden = false;
      button.textContent = name;
    });
  }

  showLayer(layer) {
    this.layer = layer;
    for (const button of document.querySelectorAll("[data-layer]")) {
      button.setAttribute("aria-pressed", Number(button.dataset.layer) === layer);
    }
    this.changeMap();
  }

  changeMap() {
    this.view.picture = null;
    this.changed = true;
  }

  nextLayer() {
    const next = (this.layer + 1) % this.maps.length;
    return this.maps[next] ? next : next + 1;
  }

  get map() {
    return this.maps[this.layer];
  }

  pause(running = !this.running) {
    this.running = running;
    this.waiting = 0;
    this.changed = true;
    if (!running) this.training?.stop();
    this.controls.update();
  }

  oneStep() {
    this.pause(false);
    this.step();
  }

  /** Plays the training, or stops it. Time runs too, unless the user prefers reduced motion. */
  playTraining() {
    if (this.training?.toggle() && !calm.matches) this.pause(true);
  }

  drive(youDrive) {
    if (youDrive && !this.episode.youDrive) this.episode.yourEffort = 0;
    this.episode.youDrive = youDrive;
    this.changed = true;
    this.controls.update();
  }

  /** Lets you drive with an effort to the left (-1), to the right (1) or with none (0). */
  choose(direction) {
    this.drive(true);
    this.episode.yourEffort = direction * this.task.maxEffort;
    this.controls.update();
  }

  /** Puts the system into a state; an episode starts there when it is released. */
  put(state, released, byKey = false) {
    this.held = !released;
    this.heldByKey = this.held && byKey;
    this.restartAnew(...state);
    this.controls.update();
  }

  /** Puts θ and θ̇; the other numbers of the state stay. */
  putOnPortrait(theta, thetadot, released, byKey = false) {
    const speed = clipped(thetadot, this.task.largest[1]);
    this.put([...this.episode.state.slice(0, -2), theta, speed], released, byKey);
  }

  /** Releases the system that a key holds. */
  letGo() {
    if (this.heldByKey) this.put(this.start, true);
  }

  redraw() {
    this.changed = true;
    if (this.training) this.training.changed = true;
  }
}
