"use strict";

/** The torque of a policy over the phase plane, computed in small portions, coarse cells first. */
class TorqueMap {
  constructor(policy, size = 97) {
    this.policy = policy; // its method `torque` returns a torque in N·m for θ and θ̇
    this.size = size; // θ from -π to π by columns, θ̇ from 8 to -8 by rows, ends included
    this.torques = new Float32Array(size * size);
    this.ready = false;
    this.#cells = this.#coarseToFine();
  }

  #cells;

  theta(column) {
    return (2 * column / (this.size - 1) - 1) * Math.PI;
  }

  thetadot(row) {
    return (1 - 2 * row / (this.size - 1)) * MAX_SPEED;
  }

  /** Computes for about `milliseconds`; returns whether the map has changed. */
  work(milliseconds) {
    if (this.ready) return false;
    const end = performance.now() + milliseconds;
    do {
      const { value, done } = this.#cells.next();
      if (done) {
        this.ready = true;
        break;
      }
      const [row, column, width] = value;
      const torque = this.policy.torque(this.theta(column), this.thetadot(row));
      for (let i = row; i < Math.min(row + width, this.size); i++) {
        const j = i * this.size + column;
        this.torques.fill(torque, j, Math.min(j + width, (i + 1) * this.size));
      }
    } while (performance.now() < end);
    return true;
  }

  *#coarseToFine() {
    for (const width of [16, 8, 4, 2, 1]) {
      for (let row = 0; row < this.size; row += width) {
        for (let column = 0; column < this.size; column += width) {
          const computed = width < 16 && row % (2 * width) === 0 && column % (2 * width) === 0;
          if (!computed) yield [row, column, width];
        }
      }
    }
  }
}
