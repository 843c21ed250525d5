"use strict";

const recorded = JSON.parse(document.getElementById("network").textContent);
const element = (id) => document.getElementById(id);
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const TRAIL = 12; // steps
const REST = 3; // s between two episodes

/** Returns the names of the networks on the page. */
function networkNames() {
  if (!recorded.against) return ["network"];
  const names = [recorded, recorded.against].map(({ name }) => name.replace(/\.(weights\.)?h5$/, ""));
  return names[0] === names[1] ? names.map((name, i) => `${name} (${i + 1})`) : names;
}

/** Returns the text on the network. */
function about(recorded) {
  const { name, preset, sizes, activation, gravity, trainedGravity, evaluatedReturn } = recorded;
  const from = preset && !name.startsWith(`${preset}.`) ? ` (preset ${preset})` : "";
  const sentences = [
    `${name}${from}, a ${sizes.slice(1, -1).join("-")} ${activation} network with ` +
      `${sizes.at(-1)} torques, on Pendulum-v1 with g = ${gravity} m/s².`,
  ];
  const elsewhere = trainedGravity !== null && trainedGravity !== gravity;
  if (elsewhere) {
    sentences.push(`Another gravity than in training: it was trained at g = ${trainedGravity} m/s².`);
  }
  if (evaluatedReturn !== null) {
    const where = elsewhere ? " there" : "";
    sentences.push(`Mean return when evaluated${where}: ${shown(evaluatedReturn, 2)}.`);
  }
  return sentences.join(" ");
}

class Page {
  /** `networks` are one or two; the second is driven from the same starts, in step. */
  constructor(networks, optimum) {
    const [network] = networks;
    this.optimum = optimum;
    this.episodes = networks.map((each) => new Episode(each, recorded.gravity));
    [this.episode, this.other] = this.episodes;
    const policies = [network, networks[1], optimum].map(
      (policy) => policy && ((theta, thetadot) => policy.torque(theta, thetadot)),
    );
    this.policies = policies;
    this.maps = policies.map((policy) => policy && new TorqueMap(policy));
    this.layer = 0;
    this.held = false; // whether a pointer holds the pendulum
    this.names = networkNames();
    this.showNames();
    this.restart();
    // 41 torques are multiples of 0.1 N·m; other counts may need a second digit.
    this.digits = network.torques.every((u) => Math.abs(u * 10 - Math.round(u * 10)) < 1e-9) ? 1 : 2;
    this.running = !calm.matches;
    this.waiting = 0; // s since the last step
    this.changed = true; // whether anything but `waiting` has changed since the last frame
    this.recolour();
    this.listen();
    this.updateControls();
    requestAnimationFrame((now) => this.frame(now, now));
  }

  /** Takes the steps that are due, 20 per second, and draws. */
  frame(now, before) {
    requestAnimationFrame((later) => this.frame(later, now));
    if (this.running && !this.held) {
      // Limited, so that a tab that was hidden does not rush through the missed steps.
      this.waiting = Math.min(this.waiting + (now - before) / 1000, 4 * TIME_STEP);
      if (this.episode.over) {
        this.resting += (now - before) / 1000; // time to read the score
        this.waiting = this.resting < REST ? 0 : TIME_STEP;
      }
      for (; this.waiting >= TIME_STEP; this.waiting -= TIME_STEP) this.step();
    }
    if (this.changed || (this.running && !calm.matches)) this.drawSwing();
    if (this.map.work(8)) {
      this.picture = null;
      this.changed = true;
    }
    if (this.changed) this.drawRest();
    this.changed = false;
  }

  /** Takes the next time step; after the last one, starts a new episode. */
  step() {
    if (this.episode.over) this.restart();
    else {
      this.episodes.forEach((episode) => episode.step());
      if (this.episode.over) this.showScore();
    }
    this.changed = true;
  }

  /** Starts an episode, with both networks from the same start. */
  restart(theta, thetadot) {
    this.episode.reset(theta, thetadot);
    this.start = this.episode.path[0];
    this.other?.reset(...this.start);
    this.optimalReturn = null;
    this.waiting = this.resting = 0;
    this.changed = true;
  }

  /** Shows the returns of the finished episode, of the network too if you drove, and the optimum. */
  showScore() {
    const { episode, other, names, start } = this;
    const youDrove = episode.drivers.has("you");
    const helped = youDrove && episode.drivers.has("network");
    const driver = helped ? `you and ${names[0]}` : youDrove ? "you" : names[0];
    const parts = [[driver, episode.return]];
    if (youDrove) {
      const { gravity } = episode;
      const total = simulatedReturn(gravity, ...start, EPISODE_STEPS, this.policies[0]);
      parts.push([names[0], total]);
    }
    if (other) parts.push([names[1], other.return]);
    const optimal = this.optimalReturn ?? this.optimum.returnFrom(...start);
    this.optimalReturn = Math.max(optimal, ...parts.map(([, total]) => total));
    parts.push(["optimum", this.optimalReturn]);
    const texts = parts.map(([name, total]) => `${name} ${shown(total, 1)}`);
    element("score").textContent = `Score: ${texts.join(" · ")}`;
  }

  /** Labels the pendulums and the layers of the map. */
  showNames() {
    const { names } = this;
    if (!this.other) return;
    element("other").hidden = false;
    document.querySelector("figcaption").hidden = false;
    names.forEach((name, i) => {
      if (i) element(`name-${i}`).textContent = name;
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
    this.picture = null;
    this.changed = true;
  }

  get map() {
    return this.maps[this.layer];
  }

  pause(running = !this.running) {
    this.running = running;
    this.waiting = 0;
    this.changed = true;
    this.updateControls();
  }

  drive(youDrive) {
    if (youDrive && !this.episode.youDrive) this.episode.yourTorque = 0;
    this.episode.youDrive = youDrive;
    this.changed = true;
    this.updateControls();
  }

  choose(torque) {
    this.drive(true);
    this.episode.yourTorque = torque;
    this.updateControls();
  }

  recolour() {
    this.colours = readColours();
    this.picture = null;
    this.changed = true;
  }

  /** Updates the buttons and the status line. */
  updateControls() {
    const { youDrive, yourTorque } = this.episode;
    element("take-over").setAttribute("aria-checked", youDrive);
    for (const button of document.querySelectorAll("[data-torque]")) {
      const pressed = youDrive && Number(button.dataset.torque) === yourTorque;
      button.setAttribute("aria-pressed", pressed);
    }
    element("pause").firstElementChild.textContent = this.running ? "Pause" : "Play";
    const network = this.other ? "Both networks drive." : "The network drives.";
    const driver = youDrive ? "You drive." : network;
    element("name-0").textContent = youDrive ? "you" : this.names[0];
    element("status").textContent = this.running ? driver : `Paused. ${driver}`;
  }

  drawSwing() {
    this.drawOne(element("pendulum"), this.episode);
    if (this.other) this.drawOne(element("pendulum-1"), this.other);
  }

  drawOne(canvas, { path, torque }) {
    const angles = path.slice(-TRAIL - 1).map(([theta]) => theta);
    // The drawing is one step behind: it moves from the previous state to the present one.
    let theta = angles.at(-1);
    if (this.running && !calm.matches && angles.length > 1) {
      const share = this.waiting / TIME_STEP;
      theta = angles.at(-2) + share * (theta - angles.at(-2));
    }
    const trail = calm.matches ? [] : [...angles.slice(0, -1), theta];
    drawPendulum(canvas, this.colours, theta, torque, trail);
  }

  drawRest() {
    const { episode, colours } = this;
    const { torques } = episode.network;
    element("torque").textContent = shown(episode.torque, this.digits, true);
    element("reward").textContent = shown(episode.reward, 2);
    element("return").textContent = shown(episode.return, 1);
    element("step").textContent = `${episode.steps}/${EPISODE_STEPS}`;
    element("theta").textContent = shown(wrapped(episode.theta), 2, true);
    element("thetadot").textContent = shown(episode.thetadot, 2, true);
    this.episodes.forEach((each, i) => {
      element(`return-${i}`).textContent = shown(each.return, 1);
    });
    if (!this.held) this.optimalReturn ??= this.optimum.returnFrom(...this.start);
    element("optimum").textContent = this.held ? "–" : shown(this.optimalReturn, 1);
    const { best, youDrive, yourTorque } = episode;
    const values = Array.from(episode.qValues, (value) => value / recorded.rewardScale);
    this.limits = steadyLimits(values, this.limits);
    const greedy = `${shown(torques[best], this.digits, true)} N·m`;
    element("best").textContent = `${greedy}: ${shown(values[best], 2)}`;
    const taken = youDrive ? yourTorque : torques[best];
    drawBars(element("bars"), colours, torques, values, this.limits, best, taken);
    this.picture ??= mapPicture(this.map, colours);
    const paths = this.episodes.map(({ path }) => path);
    drawPortrait(element("portrait"), colours, this.picture, paths);
  }

  listen() {
    const click = (button, act) =>
      button.addEventListener("click", (event) => {
        act();
        // After a click, Space pauses again instead of pressing this button.
        if (event.detail) button.blur();
      });
    click(element("take-over"), () => this.drive(!this.episode.youDrive));
    click(element("pause"), () => this.pause());
    click(element("one-step"), () => this.oneStep());
    click(element("restart"), () => this.restart());
    for (const button of document.querySelectorAll("[data-torque]")) {
      const act = () => this.choose(Number(button.dataset.torque));
      button.addEventListener("pointerdown", act); // when the finger touches, not when it leaves
      click(button, act);
    }
    for (const button of document.querySelectorAll("[data-layer]")) {
      click(button, () => this.showLayer(Number(button.dataset.layer)));
    }
    const touch = new Touch((theta, thetadot, released) => this.put(theta, thetadot, released));
    touch.listenToPendulum(element("pendulum"));
    touch.listenToPendulum(element("pendulum-1"));
    touch.listenToPortrait(element("portrait"));
    addEventListener("keydown", (event) => this.key(event));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.recolour());
    calm.addEventListener("change", () => this.pause(!calm.matches));
    const sizes = new ResizeObserver(() => (this.changed = true));
    document.querySelectorAll("canvas").forEach((canvas) => sizes.observe(canvas));
  }

  nextLayer() {
    const next = (this.layer + 1) % this.maps.length;
    return this.maps[next] ? next : next + 1;
  }

  /** Puts the pendulum into a state; an episode starts there when the pointer is released. */
  put(theta, thetadot, released) {
    this.held = !released;
    this.restart(theta, thetadot);
  }

  oneStep() {
    this.pause(false);
    this.step();
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const key = event.key.toLowerCase();
    const torque = { j: -2, arrowleft: -2, k: 0, l: 2, arrowright: 2 }[key];
    const upOrDown = key === "arrowup" || key === "arrowdown";
    if (torque !== undefined) this.choose(torque);
    // Up and down scroll the page unless you drive.
    else if (upOrDown && this.episode.youDrive) this.choose(0);
    else if (key === " " && event.target.localName !== "button" && !event.repeat) this.pause();
    else if (key === "s") this.oneStep();
    else if (key === "m" && !event.repeat) this.showLayer(this.nextLayer());
    else if (key === "h" && !event.repeat) this.restart(Math.PI, 0);
    else if (key === "r" && !event.repeat) this.restart();
    else if (key === "t" && !event.repeat) this.drive(!this.episode.youDrive);
    else return;
    event.preventDefault();
  }
}

try {
  if (!recorded) throw new Error("it contains no network");
  const networks = [recorded, recorded.against].filter(Boolean);
  element("about").textContent = [
    ...networks.map(about),
    `Written by keras_pendulum ${recorded.version}.`,
  ].join(" ");
  document.title = `Inverted pendulum: ${recorded.name}`;
  const optimum = new Optimum(recorded.optimum, recorded.gravity);
  const page = new Page(networks.map((each) => new Network(each)), optimum);
  /** Access to the page from the console and from tests. */
  window.pendulum = {
    page,
    reset: (theta, thetadot) => page.restart(theta, thetadot),
    step: () => page.step(),
    qValues: (observation) => Array.from(page.episode.network.qValues(observation)),
    state: () => {
      const { network, path, drivers, ...rest } = page.episode;
      return { ...rest, qValues: Array.from(rest.qValues), over: page.episode.over };
    },
  };
} catch (error) {
  element("problem").textContent =
    `This page is damaged (${error.message}): write it again with python -m keras_pendulum.page.`;
  element("problem").hidden = false;
}
