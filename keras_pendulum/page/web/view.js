"use strict";

const TRAIL = 12; // steps

/** Draws the state of the page. */
class View {
  constructor(page) {
    this.page = page;
    this.recolour();
  }

  /** Reads the colours of the present theme. */
  recolour() {
    this.colours = readColours(this.page.task.maxEffort);
    this.picture = null; // of the map
  }

  /** Draws the system, with each network. */
  drawSwing() {
    const { episode, other } = this.page;
    this.#drawOne(element("system"), episode);
    if (other) this.#drawOne(element("system-1"), other);
  }

  #drawOne(canvas, { path, effort, over }) {
    const { page, colours } = this;
    const states = path.slice(-TRAIL - 1);
    let present = states.pop();
    // The drawing is one step behind: it moves from the previous state to the present one.
    if (page.running && !over && !calm.matches && states.length) {
      const share = page.waiting / page.stepTime;
      const before = states.at(-1);
      present = present.map((value, i) => before[i] + share * (value - before[i]));
    }
    const trail = calm.matches ? [] : states;
    drawSystem(canvas, colours, [...trail, present], effort, page.task);
  }

  /** Updates the readings, the bars and the phase portrait. */
  drawRest() {
    const { page, colours } = this;
    const { episode, task } = page;
    const { efforts } = episode.network;
    const [theta, thetadot] = episode.state.slice(-2);
    element("effort").textContent = task.effortText(episode.effort, efforts);
    element("reward").textContent = shown(episode.reward, 2);
    element("return").textContent = shown(episode.return, task.returnDigits);
    element("step").textContent = `${episode.steps}/${task.episodeSteps}`;
    element("theta").textContent = shown(task.angle(theta), 2, true);
    element("thetadot").textContent = shown(thetadot, 2, true);
    task.readings.forEach((id, i) => (element(id).textContent = shown(episode.state[i], 2, true)));
    page.episodes.forEach((each, i) => {
      element(`return-${i}`).textContent = shown(each.return, task.returnDigits);
    });
    if (!page.held) page.optimalReturn ??= page.optimum.returnFrom(page.start);
    element("optimum").textContent = page.held ? "–" : shown(page.optimalReturn, task.returnDigits);
    const { best, youDrive, yourEffort } = episode;
    const values = Array.from(episode.qValues, (value) => value / page.recorded.rewardScale);
    const exact = page.exact?.qValues(episode.state, efforts);
    const farthest = [...values, ...(exact ?? [])].reduce((a, b) => (Math.abs(b) > Math.abs(a) ? b : a));
    this.end = steadyEnd(farthest, this.end);
    const greedy = task.bestText(efforts[best], efforts);
    const worst = shown(Math.min(...values), 2);
    element("best").textContent = `${greedy}: ${shown(values[best], 2)}, worst ${worst}`;
    const taken = youDrive ? yourEffort : efforts[best];
    const { end } = this;
    drawBars(element("bars"), colours, task, { efforts, values, exact, best, end, taken });
    const pictureOf = (width, height) => {
      const { picture } = this;
      if (picture?.width === width && picture.height === height) return picture;
      return (this.picture = mapPicture(page.map.efforts, colours, width, height));
    };
    const paths = page.episodes.map(({ path }) => path);
    drawPortrait(element("portrait"), colours, task, pictureOf, paths);
  }
}
