"use strict";

const LEARNED_MAP_SIZE = 49; // cells of θ and of θ̇, the ends included

/** Returns the index of the cell of a state, within the map. */
function learnedCell(task, state) {
  const [theta, thetadot] = state.slice(-2);
  const place = placeOf(task, [task.angle(theta), thetadot]);
  const [column, row] = place.map((share) => Math.round(clippedShare(share) * (LEARNED_MAP_SIZE - 1)));
  return row * LEARNED_MAP_SIZE + column;
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
      const best = argmax(values, start, start + efforts.length);
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
function sweptMap(table, efforts) {
  return mapOf(table.task, (state) => [efforts[argmax(table.qValues(state, efforts))], table.value(state)]);
}
