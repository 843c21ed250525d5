"use strict";

const VALUE_COLUMNS = 96; // of θ, around the circle
const VALUE_ROWS = 97; // of θ̇, the ends included

/** The values of a discounted task whose state is θ and θ̇, on a grid, linear between its points. */
class ValueTable {
  constructor(task, discount, values = new Float64Array(VALUE_ROWS * VALUE_COLUMNS)) {
    Object.assign(this, { task, discount, values });
  }

  /** Returns the Q-value of each effort in a state. */
  qValues(state, efforts) {
    return efforts.map((effort) => {
      const { state: next, reward } = this.task.advanced(state, effort);
      return reward + this.discount * this.value(next);
    });
  }

  /** Returns the lower left point of the cell of a state, and the state's place in the cell. */
  #place([theta, thetadot]) {
    const [angle, speed] = this.task.largest;
    const x = ((this.task.angle(theta) + angle) / (2 * angle)) * VALUE_COLUMNS;
    const y = ((clipped(thetadot, speed) + speed) / (2 * speed)) * (VALUE_ROWS - 1);
    const column = Math.min(Math.floor(x), VALUE_COLUMNS - 1);
    const row = Math.min(Math.floor(y), VALUE_ROWS - 2);
    return [row, column, y - row, x - column];
  }

  value(state) {
    const [row, column, up, right] = this.#place(state);
    const { values } = this;
    const start = row * VALUE_COLUMNS;
    const next = (column + 1) % VALUE_COLUMNS;
    const between = (from) => values[from + column] + right * (values[from + next] - values[from + column]);
    const lower = between(start);
    return lower + up * (between(start + VALUE_COLUMNS) - lower);
  }

  /** Returns the state of a point of the grid. */
  state(index) {
    const [angle, speed] = this.task.largest;
    const [row, column] = [Math.floor(index / VALUE_COLUMNS), index % VALUE_COLUMNS];
    return [
      (2 * angle * column) / VALUE_COLUMNS - angle,
      (2 * speed * row) / (VALUE_ROWS - 1) - speed,
    ];
  }

  /** Returns the places of the corners around a state [4] in the table, and their shares [4]. */
  corners(state) {
    const [row, column, up, right] = this.#place(state);
    const start = row * VALUE_COLUMNS;
    const next = (column + 1) % VALUE_COLUMNS;
    const places = [start + column, start + next];
    return {
      places: [...places, ...places.map((place) => place + VALUE_COLUMNS)],
      shares: [(1 - up) * (1 - right), (1 - up) * right, up * (1 - right), up * right],
    };
  }
}

/** Value iteration: a sweep sets each value to the highest r + γ·V(next) over the efforts. */
class ValueIteration {
  constructor(task, efforts, discount) {
    Object.assign(this, { efforts, discount });
    this.sweeps = 0;
    this.table = new ValueTable(task, discount);
    const count = this.table.values.length * efforts.length;
    this.rewards = new Float64Array(count);
    this.places = new Int32Array(4 * count); // of the next state's corners
    this.shares = new Float64Array(4 * count);
    for (let i = 0, k = 0; i < this.table.values.length; i++) {
      const state = this.table.state(i);
      for (const effort of efforts) {
        const next = task.advanced(state, effort);
        const { places, shares } = this.table.corners(next.state);
        this.rewards[k] = next.reward;
        this.places.set(places, 4 * k);
        this.shares.set(shares, 4 * k);
        k += 1;
      }
    }
  }

  /** Makes a sweep; returns the largest change of a value. */
  sweep() {
    const { rewards, places, shares, discount, efforts } = this;
    const before = this.table.values;
    const after = new Float64Array(before.length);
    let change = 0;
    for (let i = 0, k = 0; i < after.length; i++) {
      let highest = -Infinity;
      for (const end = k + efforts.length; k < end; k++) {
        const j = 4 * k;
        const future =
          shares[j] * before[places[j]] +
          shares[j + 1] * before[places[j + 1]] +
          shares[j + 2] * before[places[j + 2]] +
          shares[j + 3] * before[places[j + 3]];
        const value = rewards[k] + discount * future;
        if (value > highest) highest = value;
      }
      after[i] = highest;
      change = Math.max(change, Math.abs(highest - before[i]));
    }
    this.table.values = after;
    this.sweeps += 1;
    return change;
  }
}
