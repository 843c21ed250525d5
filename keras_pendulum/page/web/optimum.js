"use strict";

const OPTIMUM_TORQUES = Array.from({ length: 41 }, (_, i) => (i - 20) / 10); // N·m
const SMOOTH_TOLERANCE = 0.05; // a larger difference of value and return means a discontinuity
const SEARCHED_STEPS = 3;

/** The optimum: greedy on a table of the optimal value, as keras_pendulum/optimum describes it. */
class Optimum {
  /**
   * @param {{rows: number, columns: number, scale: number, table: string}} recorded the roots of
   *   the negative values in units of `scale`, as base64 of uint16: rows are θ̇ from -8 to 8 rad/s,
   *   columns θ from -π to 0.
   */
  constructor({ rows, columns, scale, table }, gravity) {
    Object.assign(this, { rows, columns, gravity });
    const roots = new Uint16Array(decodedBytes(table).buffer); // little-endian
    if (roots.length !== rows * columns) throw new Error("its table of the optimum has a wrong size");
    this.values = Float32Array.from(roots, (root) => -((root * scale) ** 2));
  }

  /** Returns the optimal return of 200 steps from a state, interpolated in the table. */
  value(theta, thetadot) {
    let angle = wrapped(theta);
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
  torque(theta, thetadot) {
    let [best, highest] = [0, -Infinity];
    for (const torque of OPTIMUM_TORQUES) {
      const [nextTheta, nextThetadot, reward] = advanced(this.gravity, theta, thetadot, torque);
      const value = reward + this.value(nextTheta, nextThetadot);
      if (value > highest) [best, highest] = [torque, value];
    }
    return best;
  }

  /** Returns the highest return from a start. It is simulated, so it can be attained. */
  returnFrom(theta, thetadot) {
    const greedy = this.#greedyReturn(theta, thetadot, EPISODE_STEPS);
    if (Math.abs(this.value(theta, thetadot) - greedy) <= SMOOTH_TOLERANCE) return greedy;
    return Math.max(greedy, this.#searchedReturn(theta, thetadot));
  }

  #greedyReturn(theta, thetadot, steps) {
    return simulatedReturn(this.gravity, theta, thetadot, steps, (a, b) => this.torque(a, b));
  }

  /** Tries every torque in the first steps; the torque afterwards is greedy. */
  #searchedReturn(theta, thetadot) {
    let [past, highest] = [0, -Infinity];
    for (let step = 1; step <= SEARCHED_STEPS; step++) {
      let best = null;
      highest = -Infinity;
      for (const torque of OPTIMUM_TORQUES) {
        const next = advanced(this.gravity, theta, thetadot, torque);
        const total = past + next[2] + this.#greedyReturn(next[0], next[1], EPISODE_STEPS - step);
        if (total > highest) [best, highest] = [next, total];
      }
      [theta, thetadot] = best;
      past += best[2];
    }
    return highest;
  }
}
