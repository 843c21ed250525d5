"use strict";

const SOLVED = 1e-4; // a change of a sweep, as a share of the largest value, that ends the solution

const MEASURED = 200; // updates

/** What a worker does for the page: it trains one network, or iterates values. */
class WorkerMethods {
  /**
   * Starts a run. Its starts come from the seed, too: `task.randomStart` draws from Math.random.
   *
   * @param {object} recorded the content of the page, without its networks.
   * @param {object} settings of the run.
   */
  start({ recorded, settings }) {
    const source = new Random(settings.seed, 3);
    Math.random = () => source.next();
    this.task = new Task(recorded);
    const { action_count: count, starts, highest_return: highest } = recorded.learning;
    this.trainer = new Trainer(this.task, settings, count);
    this.regret = new GreedyRegret(this.task, starts, highest);
    return { sizes: this.trainer.network.sizes };
  }

  /** Trains for some episodes; returns their records, the network and its map. */
  advance({ episodes }) {
    const { trainer, task } = this;
    const { evaluate_every: every } = trainer.settings;
    const [records, started] = [[], performance.now()];
    while (records.length < episodes && !trainer.isFinished) {
      const record = trainer.trainEpisode();
      const isDue = trainer.isFinished || (every && trainer.episode % every === 0);
      record.regret = isDue ? this.regret.of(trainer.network, trainer.efforts) : null;
      records.push(record);
    }
    return {
      records,
      seconds: (performance.now() - started) / 1000,
      weights: Float32Array.from(trainer.network.weights),
      visits: trainer.visits.counts.slice(),
      path: trainer.path,
      ...learnedMap(trainer.network, task, trainer.efforts),
    };
  }

  /** Measures updates; returns their seconds, and how many numbers an observation has. */
  measure({ recorded, settings }) {
    const rows = settings.batch_size;
    const trainer = new Trainer(new Task(recorded), settings, recorded.learning.action_count);
    const [inputs] = trainer.network.sizes;
    for (let i = 0; i < rows; i++) {
      const observation = new Float32Array(inputs).fill(i / rows);
      trainer.replay.add(observation, 0, -1, observation, 0);
    }
    const batch = trainer.replay.sample(new Random(0));
    let started = 0;
    for (let i = 0; i < MEASURED; i++) {
      if (i === MEASURED / 2) started = performance.now(); // compiled by then
      trainer.learner.update(batch);
    }
    return { secondsPerUpdate: (performance.now() - started) / 1000 / (MEASURED / 2), inputs };
  }

  /** Starts value iteration from 0; `efforts` are those of the network. */
  startSweeps({ recorded, discount }) {
    const task = new Task(recorded);
    const efforts = task.efforts(recorded.learning.action_count);
    this.iteration = new ValueIteration(task, efforts, discount);
    return null;
  }

  /** Returns the map of the optimum, for a task whose table is in the page. */
  optimalMap({ recorded }) {
    const task = new Task(recorded);
    const optimum = new Optimum(recorded.optimum, task);
    return mapOf(task, (state) => [optimum.effort(state), optimum.value(state)]);
  }

  /** Makes some sweeps, all that the solution needs by default; returns the values and their map. */
  sweep({ count = Infinity }) {
    const { iteration } = this;
    const started = iteration.sweeps;
    let isSolved = false;
    while (iteration.sweeps - started < count && !isSolved) {
      const change = iteration.sweep();
      const largest = iteration.table.values.reduce((most, each) => Math.max(most, Math.abs(each)), 0);
      isSolved = change <= SOLVED * (1 - iteration.discount) * largest;
    }
    const { table, efforts, discount, sweeps } = iteration;
    return { values: table.values, map: sweptMap(table, efforts, discount), sweeps, isSolved };
  }
}

/** Answers the messages of the page in a worker. */
function serveWorker(scope) {
  const methods = new WorkerMethods();
  scope.onmessage = ({ data: { id, method, argument } }) => {
    try {
      scope.postMessage({ id, result: methods[method](argument) });
    } catch (error) {
      scope.postMessage({ id, problem: error.message });
    }
  };
}
