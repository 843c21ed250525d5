"use strict";

/** Returns the settings of a run: those of the page, the changes of the switches, then others. */
function runSettings({ settings, switches }, names, others) {
  const changes = names.map((name) => {
    const found = switches.find((each) => each.name === name);
    if (!found) throw new Error(`unknown fault ${name}; expected ${switches.map((each) => each.name).join(", ")}`);
    return found.changes;
  });
  const unknown = Object.keys(others).find((name) => !(name in settings));
  if (unknown) throw new Error(`unknown setting ${unknown}; expected ${Object.keys(settings).join(", ")}`);
  return Object.assign({}, settings, ...changes, others);
}

/** A run in a worker, as the page sees it. */
class LearningRun {
  /**
   * @param {object} recorded the content of the page.
   * @param {object} settings see `runSettings`.
   */
  constructor(recorded, settings) {
    this.settings = settings;
    this.records = []; // of the episodes
    this.regrets = []; // the records with a greedy regret
    this.last = null; // the last answer of the worker: the network, its map, the visits, a path
    this.updatesPerSecond = 0;
    this.#worker = new LearningWorker(recorded);
    this.#started = this.#worker.call("start", { settings });
    this.#started.catch(() => {}); // `advance` rejects, too
  }

  #worker;
  #started;

  get isFinished() {
    return this.records.length >= this.settings.episodes;
  }

  get updates() {
    return this.records.at(-1)?.updates ?? 0;
  }

  /** Trains for some episodes. Rejects where learning has diverged. */
  async advance(episodes) {
    if (this.isFinished) return;
    this.sizes = (await this.#started).sizes;
    const before = this.updates;
    this.last = await this.#worker.call("advance", { episodes });
    this.records.push(...this.last.records);
    this.regrets.push(...this.last.records.filter(({ regret }) => regret !== null));
    const { seconds } = this.last;
    if (this.updates > before) this.updatesPerSecond = (this.updates - before) / seconds;
  }

  end() {
    this.#worker.end();
  }
}

/** Trains a network to the end; resolves to its greedy regret, the updates and the seconds. */
async function trainInPage(recorded, { fault = "", ...others }) {
  const names = fault.split(",").filter(Boolean);
  const run = new LearningRun(recorded, runSettings(recorded.learning, names, others));
  const started = performance.now();
  try {
    while (!run.isFinished) await run.advance(20);
  } finally {
    run.end();
  }
  const seconds = (performance.now() - started) / 1000;
  return { regret: run.regrets.at(-1).regret, updates: run.updates, seconds };
}
