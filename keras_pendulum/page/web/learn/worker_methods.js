"use strict";

const SOLVED = 1e-4; // a change of a sweep, as a share of the largest value, that ends the solution

const MEASURED = 200; // updates

/** What a worker does for the page: it trains one network, or iterates values. */
class WorkerMethods {
  /** `recorded` is the content of the page, without its networks. */
  constructor(recorded) {
    this.recorded = recorded;
    this.task = new Task(recorded);
  }

  /** Starts a run. Its starts come from the seed, too: `task.randomStart` draws from Math.random. */
  start({ settings }) {
    const source = new Random(settings.seed, 3);
    Math.random = () => source.next();
    this.trainer = new Trainer(this.task, settings, this.recorded.learning.action_count);
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
      record.regret = isDue ? this.#greedyRegret() : null;
      records.push(record);
    }
    return {
      records,
      seconds: (performance.now() - started) / 1000,
      weights: Float32Array.from(trainer.network.weights),
      visits: trainer.visits.slice(),
      path: trainer.path,
      ...learnedMap(trainer.network, task, trainer.efforts),
    };
  }

  /** Measures updates; returns their seconds, and how many numbers an observation has. */
  measure() {
    const { settings, action_count: count } = this.recorded.learning;
    const rows = settings.batch_size;
    const trainer = new Trainer(this.task, settings, count);
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
  startSweeps({ discount }) {
    const efforts = this.task.efforts(this.recorded.learning.action_count);
    this.iteration = new ValueIteration(this.task, efforts, discount);
    return null;
  }

  /** Returns the map of the optimum, for a task whose table is in the page. */
  optimalMap() {
    const optimum = new Optimum(this.recorded.optimum, this.task);
    return mapOf(this.task, (state) => [optimum.effort(state), optimum.value(state)]);
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
    const { table, efforts, sweeps } = iteration;
    return { values: table.values, map: sweptMap(table, efforts), sweeps, isSolved };
  }

  /**
   * Returns the highest return minus that of the greedy policy, mean over the page's fixed starts. All
   * episodes advance together, because batches are faster.
   */
  #greedyRegret() {
    const { task } = this;
    const { network, efforts } = this.trainer;
    const { starts, highest_return: highest } = this.recorded.learning;
    const inputs = network.sizes[0];
    let [states, total] = [starts, 0];
    const observations = new Float64Array(states.length * inputs);
    for (let step = 0; step < task.episodeSteps && states.length; step++) {
      states.forEach((state, row) => observations.set(task.observed(state), row * inputs));
      const values = network.qValues(observations, states.length);
      const next = states.map((state, row) => {
        const start = row * efforts.length;
        return task.advanced(state, efforts[argmax(values, start, start + efforts.length) - start]);
      });
      total += next.reduce((sum, { reward }) => sum + reward, 0);
      states = next.filter(({ over }) => !over).map(({ state }) => state);
    }
    return highest - total / starts.length;
  }
}

/** Answers the messages of the page in a worker. The first one is what it needs of the content. */
function serveWorker(scope) {
  scope.onmessage = ({ data: recorded }) => {
    const methods = new WorkerMethods(recorded);
    scope.onmessage = ({ data: { id, method, argument } }) => {
      try {
        scope.postMessage({ id, result: methods[method](argument) });
      } catch (error) {
        scope.postMessage({ id, problem: error.message });
      }
    };
  };
}
