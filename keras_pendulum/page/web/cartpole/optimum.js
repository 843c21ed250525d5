"use strict";

const POINTS = [25, 25, 31, 31]; // of x, ẋ, θ and θ̇
const ENDS = [LARGEST_POSITION, 3, LARGEST_ANGLE, 3]; // of the grid, on both sides
const LOOKAHEAD = 4; // exact steps before the value is interpolated: near a fall, the grid is coarse
const SURVIVING = 0.9; // share of the highest value that only a pole has which need not fall

/** The optimum: greedy on a table of the optimal value, as keras_pendulum/optimum describes it. */
class Optimum {
  /**
   * @param {{discount: number, table: Uint16Array}} recorded γ, and the optimal value at the first
   *   half of the grid points, in shares of the highest one, which is 65535.
   */
  constructor({ discount, table }, task) {
    this.discount = discount;
    this.task = task;
    this.highest = 1 / (1 - discount);
    const count = POINTS.reduce((product, points) => product * points, 1);
    if (table.length !== (count + 1) / 2) throw new Error("its table of the optimum has a wrong size");
    // The last half are the mirrored states, which have the same values.
    const share = (i) => table[Math.min(i, count - 1 - i)];
    this.values = Float32Array.from({ length: count }, (_, i) => (share(i) / 65535) * this.highest);
    this.corner = { low: new Int32Array(4), weight: new Float64Array(4) };
  }

  /** Returns the optimal value of a state: the best of some exact steps, then the table's. */
  value(state, steps = LOOKAHEAD) {
    if (!steps) return this.#interpolated(state);
    return Math.max(...this.task.efforts().map((push) => this.#pushed(state, push, steps - 1)));
  }

  /** Returns the Q-value of each push in a state. */
  qValues(state, pushes) {
    return pushes.map((push) => this.#pushed(state, push, LOOKAHEAD));
  }

  /** Returns the optimal push in N; 0 where all is lost. */
  effort(state) {
    return this.value(state) > SURVIVING * this.highest ? this.#better(state) : 0;
  }

  /** Returns the highest return from a start. It is simulated, so it can be attained. */
  returnFrom(state) {
    const { task } = this;
    return simulatedReturn(task, state, task.episodeSteps, (each) => this.#better(each));
  }

  /** Resolves to the exact values for a discount; null for another one than that of the table. */
  async exactValues(recorded, discount) {
    return discount === this.discount ? this : null;
  }

  #better(state) {
    const pushes = this.task.efforts();
    return pushes[argmax(this.qValues(state, pushes))];
  }

  #pushed(state, push, steps) {
    const { state: next, reward, over } = this.task.advanced(state, push);
    return reward + (over ? 0 : this.discount * this.value(next, steps));
  }

  /** Returns the value between the 16 grid points around a state. */
  #interpolated(state) {
    const { low, weight } = this.corner;
    for (let i = 0; i < 4; i++) {
      const place = ((clipped(state[i], ENDS[i]) + ENDS[i]) / (2 * ENDS[i])) * (POINTS[i] - 1);
      low[i] = Math.min(Math.floor(place), POINTS[i] - 2);
      weight[i] = place - low[i];
    }
    let sum = 0;
    for (let upper = 0; upper < 16; upper++) {
      let [index, share] = [0, 1];
      for (let i = 0; i < 4; i++) {
        const above = (upper >> i) & 1;
        index = index * POINTS[i] + low[i] + above;
        share *= above ? weight[i] : 1 - weight[i];
      }
      if (share) sum += share * this.values[index];
    }
    return sum;
  }
}
