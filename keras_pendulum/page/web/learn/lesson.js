"use strict";

const CHUNK = 0.2; // s that a worker trains before the page draws
const SWEEP_PAUSE = 0.12; // s, at least, that the page shows a sweep

/** A lesson: one run, or a healthy and a faulty one from one seed, and the exact values. */
class Lesson {
  /**
   * @param {object} recorded the content of the page.
   * @param {Task} task
   * @param {object} choices see `readAddress`.
   * @param {function} changed called when something else is to be drawn.
   */
  constructor(recorded, task, choices, changed) {
    Object.assign(this, { recorded, task, choices, changed });
    this.running = false;
    this.isSweeping = false;
    this.runs = [];
    this.problem = "";
    this.exact = null; // {values, efforts} of the solution over the map; `of` has its `qValues`
    this.swept = null; // the same after some sweeps, and `sweeps`
    this.canSweep = task.randomStart().length === 2; // a table on more axes takes too long
    this.#reset();
  }

  #isLooping = false;
  #solver = null;

  /** Starts anew with other choices. */
  choose(changes) {
    Object.assign(this.choices, changes);
    this.#reset();
  }

  #reset() {
    this.runs.forEach((run) => run.end());
    const { faults, seed, units } = this.choices;
    const others = { seed, hidden_units: units };
    const kinds = faults.length ? [[], faults] : [[]];
    this.runs = kinds.map((names) => {
      const settings = runSettings(this.recorded.learning, names, others);
      return new LearningRun(this.recorded, settings);
    });
    this.problem = "";
    this.changed();
  }

  get isFinished() {
    return this.runs.every(({ isFinished }) => isFinished);
  }

  get episode() {
    return Math.max(...this.runs.map(({ records }) => records.length));
  }

  /** Trains, or pauses. */
  run(running) {
    this.running = running && !this.isFinished && !this.problem;
    this.changed();
    if (this.running && !this.#isLooping) this.#loop();
  }

  /** Trains for one episode. */
  async step() {
    this.run(false);
    if (this.#isLooping) return;
    this.#isLooping = true;
    await this.#advance(1);
    this.#isLooping = false;
  }

  async #loop() {
    this.#isLooping = true;
    let count = 1; // episodes until the page draws
    while (this.running) {
      const { speed } = this.choices;
      const began = performance.now();
      if (speed) count = Math.max(1, Math.round(speed * CHUNK));
      await this.#advance(count);
      const seconds = (performance.now() - began) / 1000;
      if (speed) await rested(count / speed - seconds);
      else count = Math.max(1, Math.min(2 * count, Math.round((count * CHUNK) / seconds), 50));
    }
    this.#isLooping = false;
  }

  /** Trains each run for some episodes; they stay side by side. */
  async #advance(count) {
    const { runs } = this;
    const results = await Promise.allSettled(runs.map((run) => run.advance(count)));
    if (runs !== this.runs) return; // the choices have changed meanwhile
    results.forEach(({ reason }, i) => {
      if (!reason) return;
      const name = i ? "with the fault, " : "";
      this.problem = `Stopped: ${name}${reason.message}.`;
    });
    if (this.problem || this.isFinished) this.running = false;
    this.changed();
  }

  /** Computes the exact values, once. */
  async solve(optimum) {
    if (this.#solver) return;
    this.#solver = new LearningWorker(this.recorded);
    if (this.canSweep) {
      await this.#startSweeps();
      this.exact = this.swept = await this.#sweep({});
    } else {
      const of = await optimum.exactValues(this.recorded, this.discount);
      const map = await this.#solver.call("optimalMap");
      if (of) this.exact = this.swept = { ...map, of };
    }
    this.changed();
  }

  /** Shows value iteration from 0, sweep by sweep; stops it where it runs. */
  async toggleSweeps() {
    if (this.isSweeping || !this.exact) {
      this.isSweeping = false;
      return;
    }
    this.isSweeping = true;
    await this.#startSweeps();
    do {
      const began = performance.now();
      this.swept = await this.#sweep({ count: 1 });
      this.changed();
      await rested(SWEEP_PAUSE - (performance.now() - began) / 1000);
    } while (this.isSweeping && !this.swept.isSolved);
    this.isSweeping = false;
    this.changed();
  }

  #startSweeps() {
    return this.#solver.call("startSweeps", { discount: this.discount });
  }

  async #sweep(argument) {
    const result = await this.#solver.call("sweep", argument);
    const of = new ValueTable(this.task, this.discount, result.values);
    return { ...result, ...result.map, of };
  }

  /** γ of the healthy run. */
  get discount() {
    return this.recorded.learning.settings.discount;
  }

  /** Returns the backup of a state in a run; null before the run's first episode. */
  backup(run, state) {
    const { last, settings, sizes } = run;
    if (!last) return null;
    if (run.networkOf !== last) {
      const recorded = { sizes, activation: settings.activation };
      Object.assign(run, { network: new Network(recorded, last.weights, this.task), networkOf: last });
    }
    return new Backup(state, run.network, settings, this.exact?.of);
  }
}

/** Resolves after some seconds. */
function rested(seconds) {
  return new Promise((resolve) => setTimeout(resolve, Math.max(0, 1000 * seconds)));
}
