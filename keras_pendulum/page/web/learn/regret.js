"use strict";

/** The greedy regret: the highest return minus that of the greedy policy, mean over fixed starts. */
class GreedyRegret {
  /**
   * @param {Task} task
   * @param {number[][]} starts the states.
   * @param {number} highest the mean of the highest returns from the starts.
   */
  constructor(task, starts, highest) {
    Object.assign(this, { task, starts, highest });
  }

  /** Returns the regret of a network. All episodes advance together, because batches are faster. */
  of(network, efforts) {
    const { task } = this;
    const inputs = network.sizes[0];
    let states = this.starts;
    let total = 0;
    const observations = new Float64Array(states.length * inputs);
    for (let step = 0; step < task.episodeSteps && states.length; step++) {
      states.forEach((state, row) => observations.set(task.observed(state), row * inputs));
      const values = network.qValues(observations, states.length);
      const next = states.map((state, row) => {
        const start = row * efforts.length;
        let best = start;
        for (let i = start; i < start + efforts.length; i++) if (values[i] > values[best]) best = i;
        return task.advanced(state, efforts[best - start]);
      });
      total += next.reduce((sum, { reward }) => sum + reward, 0);
      states = next.filter(({ over }) => !over).map(({ state }) => state);
    }
    return this.highest - total / this.starts.length;
  }
}
