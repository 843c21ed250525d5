"use strict";

const LEARNED_MAP_SIZE = 49; // cells of θ and of θ̇, the ends included

/**
 * Returns the θ and θ̇ of a cell of a map with `size` rows and columns. Row 0 is the highest, and what
 * leans to the right is on the right.
 */
function cellState(task, size, row, column) {
  const [angle, speed] = task.largest;
  return [((2 * column) / (size - 1) - 1) * task.rightward * angle, (1 - (2 * row) / (size - 1)) * speed];
}

/** Returns the row and the column of the cell of a state, within the map. */
function stateCell(task, size, state) {
  const [theta, thetadot] = state.slice(-2);
  const [angle, speed] = task.largest;
  const place = (share) => Math.round(((clipped(share, 1) + 1) / 2) * (size - 1));
  return [place(-thetadot / speed), place((task.rightward * task.angle(theta)) / angle)];
}

/** How often each cell of the map was visited in training. */
class Visits {
  constructor(task) {
    this.task = task;
    this.counts = new Float32Array(LEARNED_MAP_SIZE ** 2);
  }

  add(state) {
    const [row, column] = stateCell(this.task, LEARNED_MAP_SIZE, state);
    this.counts[row * LEARNED_MAP_SIZE + column] += 1;
  }
}

/**
 * Returns the greedy efforts and the highest Q-values over the phase plane. The other numbers of a
 * state, such as the position of the cart, are 0.
 */
function learnedMap(network, task, efforts) {
  const size = LEARNED_MAP_SIZE;
  const map = { efforts: new Float32Array(size ** 2), values: new Float32Array(size ** 2) };
  const others = task.randomStart().slice(2).fill(0);
  const inputs = network.sizes[0];
  const observations = new Float64Array(size * inputs);
  for (let row = 0; row < size; row++) {
    for (let column = 0; column < size; column++) {
      const state = [...others, ...cellState(task, size, row, column)];
      observations.set(task.observed(state), column * inputs);
    }
    const values = network.qValues(observations, size);
    for (let column = 0; column < size; column++) {
      const start = column * efforts.length;
      let best = start;
      for (let i = start; i < start + efforts.length; i++) if (values[i] > values[best]) best = i;
      map.efforts[row * size + column] = efforts[best - start];
      map.values[row * size + column] = values[best];
    }
  }
  return map;
}

/** Returns a map of efforts and values; `solved` returns both for a state. */
function mapOf(task, solved) {
  const size = LEARNED_MAP_SIZE;
  const map = { efforts: new Float32Array(size ** 2), values: new Float32Array(size ** 2) };
  const others = task.randomStart().slice(2).fill(0);
  for (let i = 0; i < size ** 2; i++) {
    const state = [...others, ...cellState(task, size, Math.floor(i / size), i % size)];
    [map.efforts[i], map.values[i]] = solved(state);
  }
  return map;
}

/** Returns the values of a table over the phase plane, and the efforts that are greedy for them. */
function sweptMap(table, efforts, discount) {
  const exact = new ExactValues(table.task, discount, (state) => table.value(state));
  return mapOf(table.task, (state) => [efforts[argmax(exact.qValues(state, efforts))], table.value(state)]);
}
