"use strict";

const OPTIMUM_TORQUES = Array.from({ length: 41 }, (_, i) => (i - 20) / 10); // N·m
const SMOOTH_TOLERANCE = 0.05; // a larger difference of value and return means a discontinuity
const SEARCHED_STEPS = 3;
const LARGEST_DISCOUNT = 0.995; // a larger one needs thousands of sweeps

/** The optimum: greedy on a table of the optimal value, as keras_pendulum/optimum describes it. */
class Optimum {
  /**
   * @param {{rows: number, columns: number, scale: number, table: Uint16Array}} recorded the roots
   *   of the negative values in units of `scale`: rows are θ̇ from -8 to 8 rad/s, columns θ from -π
   *   to 0.
   */
  constructor({ rows, columns, scale, table }, task) {
    Object.assign(this, { rows, columns, task });
    if (table.length !== rows * columns) throw new Error("its table of the optimum has a wrong size");
    this.values = Float32Array.from(table, (root) => -((root * scale) ** 2));
  }

  /** Returns the optimal return of 200 steps from a state, interpolated in the table. */
  value([theta, thetadot]) {
    let angle = this.task.angle(theta);
    let speed = thetadot;
    if (angle > 0) [angle, speed] = [-angle, -speed]; // the mirrored state has the same value
    const y = ((speed + MAX_SPEED) / (2 * MAX_SPEED)) * (this.rows - 1);
    const x = (angle / Math.PI + 1) * (this.columns - 1);
    const row = Math.min(Math.floor(y), this.rows - 2);
    const column = Math.min(Math.floor(x), this.columns - 2);
    const corner = row * this.columns + column;
    const between = (i) => this.values[i] + (x - column) * (this.values[i + 1] - this.values[i]);
    const lower = between(corner);
    return lower + (y - row) * (between(corner + this.columns) - lower);
  }

  /** Returns the optimal torque in N·m. */
  effort(state) {
    let [best, highest] = [0, -Infinity];
    for (const torque of OPTIMUM_TORQUES) {
      const next = this.task.advanced(state, torque);
      const value = next.reward + this.value(next.state);
      if (value > highest) [best, highest] = [torque, value];
    }
    return best;
  }

  /** Returns the highest return from a start. It is simulated, so it can be attained. */
  returnFrom(state) {
    const greedy = this.#greedyReturn(state, this.task.episodeSteps);
    if (Math.abs(this.value(state) - greedy) <= SMOOTH_TOLERANCE) return greedy;
    return Math.max(greedy, this.#searchedReturn(state));
  }

  #greedyReturn(state, steps) {
    return simulatedReturn(this.task, state, steps, (each) => this.effort(each));
  }

  /** Resolves to the exact values for a discount, from a table that a worker makes; null for γ near 1. */
  async exactValues(recorded, discount) {
    if (!(discount <= LARGEST_DISCOUNT)) return null;
    const worker = new LearningWorker(recorded);
    try {
      await worker.call("startSweeps", { discount });
      const { values } = await worker.call("sweep");
      return new ValueTable(this.task, discount, values);
    } finally {
      worker.end();
    }
  }

  /** Tries every torque in the first steps; the torque afterwards is greedy. */
  #searchedReturn(state) {
    let [past, highest] = [0, -Infinity];
    for (let step = 1; step <= SEARCHED_STEPS; step++) {
      let best = null;
      highest = -Infinity;
      for (const torque of OPTIMUM_TORQUES) {
        const next = this.task.advanced(state, torque);
        const rest = this.task.episodeSteps - step;
        const total = past + next.reward + this.#greedyReturn(next.state, rest);
        if (total > highest) [best, highest] = [next, total];
      }
      state = best.state;
      past += best.reward;
    }
    return highest;
  }
}
