"use strict";

const TRAIL = 12; // steps

/** Draws the state of the page. */
class View {
  constructor(page) {
    this.page = page;
    // 41 torques are multiples of 0.1 N·m; other counts may need a second digit.
    const { torques } = page.episode.network;
    this.digits = torques.every((u) => Math.abs(u * 10 - Math.round(u * 10)) < 1e-9) ? 1 : 2;
    this.recolour();
  }

  /** Reads the colours of the present theme. */
  recolour() {
    this.colours = readColours();
    this.picture = null; // of the torque map
  }

  /** Draws the pendulums. */
  drawSwing() {
    const { episode, other } = this.page;
    this.#drawOne(element("pendulum"), episode);
    if (other) this.#drawOne(element("pendulum-1"), other);
  }

  #drawOne(canvas, { path, torque }) {
    const angles = path.slice(-TRAIL - 1).map(([theta]) => theta);
    // The drawing is one step behind: it moves from the previous state to the present one.
    let theta = angles.at(-1);
    if (this.page.running && !calm.matches && angles.length > 1) {
      const share = this.page.waiting / TIME_STEP;
      theta = angles.at(-2) + share * (theta - angles.at(-2));
    }
    const trail = calm.matches ? [] : [...angles.slice(0, -1), theta];
    drawPendulum(canvas, this.colours, theta, torque, trail);
  }

  /** Updates the readings, the bars and the phase portrait. */
  drawRest() {
    const { page, colours } = this;
    const { episode } = page;
    const { torques } = episode.network;
    element("torque").textContent = shown(episode.torque, this.digits, true);
    element("reward").textContent = shown(episode.reward, 2);
    element("return").textContent = shown(episode.return, 1);
    element("step").textContent = `${episode.steps}/${EPISODE_STEPS}`;
    element("theta").textContent = shown(wrapped(episode.theta), 2, true);
    element("thetadot").textContent = shown(episode.thetadot, 2, true);
    page.episodes.forEach((each, i) => {
      element(`return-${i}`).textContent = shown(each.return, 1);
    });
    if (!page.held) page.optimalReturn ??= page.optimum.returnFrom(...page.start);
    element("optimum").textContent = page.held ? "–" : shown(page.optimalReturn, 1);
    const { best, youDrive, yourTorque } = episode;
    const values = Array.from(episode.qValues, (value) => value / page.recorded.rewardScale);
    this.floor = steadyFloor(Math.min(...values) - values[best], this.floor);
    const greedy = `${shown(torques[best], this.digits, true)} N·m`;
    element("best").textContent = `${greedy}: ${shown(values[best], 2)}`;
    const taken = youDrive ? yourTorque : torques[best];
    drawBars(element("bars"), colours, torques, values, this.floor, best, taken);
    const pictureOf = (width, height) => {
      const { picture } = this;
      if (picture?.width === width && picture.height === height) return picture;
      return (this.picture = mapPicture(page.map, colours, width, height));
    };
    const paths = page.episodes.map(({ path }) => path);
    drawPortrait(element("portrait"), colours, pictureOf, paths);
  }
}
