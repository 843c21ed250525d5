"use strict";

const LAYER_TITLES = { effort: "", value: "value max Q", error: "max Q − exact", visits: "visits" };

/** Draws a lesson: its curves, its maps, and the backup of a cell. */
class LessonView {
  constructor(lesson, task) {
    Object.assign(this, { lesson, task });
    this.layer = "effort";
    this.cell = [Math.floor(LEARNED_MAP_SIZE / 2), Math.floor(LEARNED_MAP_SIZE / 4)]; // row, column
    this.chosen = 0; // the run whose backup is shown
    this.recolour();
  }

  /** Reads the colours of the present theme. */
  recolour() {
    this.colours = readColours(this.task.maxEffort);
  }

  draw() {
    const { lesson } = this;
    if (this.chosen >= lesson.runs.length) this.chosen = 0;
    this.#drawCurves();
    this.#writeReadings();
    this.#drawMaps();
    this.#drawBackup();
  }

  /** The state of the chosen cell; numbers before θ, such as the position of the cart, are 0. */
  get state() {
    const others = this.task.randomStart().slice(2).fill(0);
    return [...others, ...cellState(this.task, LEARNED_MAP_SIZE, ...this.cell)];
  }

  #drawCurves() {
    const { lesson, colours, task } = this;
    const end = lesson.runs[0].settings.episodes;
    const styles = [{ colour: colours.accent }, { colour: colours.plus, dashed: true }];
    const ofStep = task.curveName.endsWith("step");
    const returns = lesson.runs.map(({ records }, i) => {
      const values = records.map((each) => each.episodeReturn / (ofStep ? each.steps : 1));
      const points = trailingMeans(values).map((value, k) => [k + 1, value]);
      return { ...styles[i], points };
    });
    const title = `${task.curveName}, mean of ${AVERAGED_EPISODES} episodes`;
    drawCurves(element("learning-curve"), colours, returns, returnAxis(returns, end, title));
    const regrets = lesson.runs.map((run, i) => ({
      ...styles[i],
      points: run.regrets.map(({ episode, regret }) => [episode + 1, regret]),
    }));
    const axis = regretAxis(regrets, end, "greedy regret: optimum − return");
    drawCurves(element("regret-curve"), colours, regrets, axis);
  }

  #writeReadings() {
    const { lesson } = this;
    const hasFault = lesson.runs.length > 1;
    for (const each of document.querySelectorAll("[data-faulty]")) each.hidden = !hasFault;
    lesson.runs.forEach((run, i) => {
      const last = run.records.at(-1);
      const regret = run.regrets.at(-1)?.regret;
      const texts = {
        episode: `${run.records.length}/${run.settings.episodes}`,
        updates: `${run.updates}`,
        epsilon: last ? shown(last.epsilon, 3) : "–",
        loss: last?.loss == null ? "–" : last.loss.toPrecision(2),
        regret: regret === undefined ? "–" : shown(regret, 1),
        speed: run.updatesPerSecond ? `${Math.round(run.updatesPerSecond)}` : "–",
      };
      for (const [name, text] of Object.entries(texts)) {
        document.querySelector(`[data-reading="${name}-${i}"]`).textContent = text;
      }
    });
  }

  #drawMaps() {
    const { lesson, layer, colours, task } = this;
    const layers = new Layers(task, colours, lesson.exact);
    const maps = [lesson.runs[0].last, lesson.runs[1]?.last, lesson.swept];
    maps.forEach((map, i) => {
      const canvas = element(`learned-map-${i}`);
      if (!canvas.clientWidth) return;
      const pictureOf = (width, height) => {
        const picture = map && layers.picture(layer, map, width, height);
        return picture ?? new OffscreenCanvas(width, height);
      };
      const path = i < 2 && map?.path;
      drawPortrait(canvas, colours, task, pictureOf, path ? [path] : []);
      if (i === this.chosen) this.#markCell(canvas);
    });
    const [lowest, highest] = layers.ends(layer, maps.find(Boolean));
    const isCount = layer === "visits";
    const text = (value) => (isCount ? `${Math.round(Math.expm1(value))}` : shown(value, 1, layer !== "value"));
    element("scale-low").textContent = text(lowest);
    element("scale-high").textContent = `${text(highest)} ${layer === "effort" ? task.effortAxis : LAYER_TITLES[layer]}`;
    element("learned-scale").dataset.scale = layer;
    const { swept } = lesson;
    element("sweeps").textContent = swept ? `${swept.sweeps} sweeps, γ = ${lesson.discount}` : "computing …";
    element("sweep").firstElementChild.textContent = lesson.isSweeping ? "Stop" : "Sweep from 0";
  }

  #markCell(canvas) {
    const { colours, task } = this;
    const context = canvas.getContext("2d");
    const [left, right, top, bottom] = portraitEdges(canvas.clientWidth, canvas.clientHeight);
    const [row, column] = this.cell.map((each) => each / (LEARNED_MAP_SIZE - 1));
    const [x, y] = [left + column * (right - left), top + row * (bottom - top)];
    const sharpness = window.devicePixelRatio || 1;
    context.setTransform(sharpness, 0, 0, sharpness, 0, 0);
    for (const [colour, width] of [[colours.halo, 5], [colours.path, 2]]) {
      context.strokeStyle = colour;
      context.lineWidth = width;
      context.strokeRect(x - 7, y - 7, 14, 14);
    }
    const backup = this.lesson.backup(this.lesson.runs[this.chosen], this.state);
    if (!backup) return;
    const [angle, speed] = task.largest;
    for (const i of backup.steps.keys()) {
      const [theta, thetadot] = backup.steps[i].state.slice(-2);
      const px = left + ((theta / angle + 1) / 2) * (right - left);
      const py = top + ((1 - thetadot / speed) / 2) * (bottom - top);
      context.strokeStyle = i === backup.best ? colours.path : `rgb(${colours.ofEffort(backup.efforts[i])})`;
      context.lineWidth = 1.5;
      line(context, [[x, y], [px, py]]);
    }
  }

  #drawBackup() {
    const { lesson, colours, task } = this;
    const backup = lesson.backup(lesson.runs[this.chosen], this.state);
    const whose = lesson.runs.length > 1 ? ["healthy: ", "with the fault: "][this.chosen] : "";
    element("backup-text").textContent = backup
      ? whose + backup.text(task)
      : "After the first episode: choose a cell of a map.";
    for (const id of ["fan", "backup-curve"]) blank(element(id));
    if (!backup) return;
    drawFan(element("fan"), colours, task, backup);
    drawBackup(element("backup-curve"), colours, task, backup);
  }
}
