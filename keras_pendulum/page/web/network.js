"use strict";

/** The Q-network of the weights file: Dense layers, then one linear output for each action. */
class Network {
  /**
   * @param {{sizes: number[], activation: string}} recorded sizes of all layers, the observation's
   *   first; one activation for all hidden layers, or one for each, separated by commas.
   * @param {Float32Array} numbers the weights: kernel [in, out] and bias [out] of each layer in order.
   * @param {Task} task
   */
  constructor({ sizes, activation }, numbers, task) {
    this.task = task;
    const expected = sizes.slice(1).reduce((sum, units, i) => sum + (sizes[i] + 1) * units, 0);
    if (numbers.length !== expected) {
      throw new Error(`it contains ${numbers.length} weights; expected ${expected}`);
    }
    let start = 0;
    const activations = activation.split(",").map((name) => Network.#ACTIVATIONS[name]);
    const taken = (count) => numbers.subarray(start, (start += count));
    this.layers = sizes.slice(1).map((units, i) => ({
      kernel: taken(sizes[i] * units),
      bias: taken(units),
      activate: i === sizes.length - 2 ? (x) => x : (activations[i] ?? activations[0]),
      sums: new Float64Array(2 * units), // of two observations
      output: new Float32Array(2 * units),
    }));
    this.efforts = task.efforts(sizes.at(-1));
  }

  static #ACTIVATIONS = { tanh: Math.tanh, relu: (x) => (x > 0 ? x : 0), linear: (x) => x };

  /** Returns the Q-values [A] of an observation; the next call overwrites the array. */
  qValues(observation) {
    return this.#pair(observation, observation).subarray(0, this.efforts.length);
  }

  /** Returns the greedy effort. */
  effort(state) {
    return this.effortsOf([state])[0];
  }

  /** Returns the greedy effort of each state, at most two of them. */
  effortsOf(states) {
    const [one, other] = states.map((state) => this.task.observed(state));
    const values = this.#pair(one, other ?? one);
    const { efforts } = this;
    const { length } = efforts;
    return states.map((_, i) => efforts[argmax(values, i * length, (i + 1) * length) - i * length]);
  }

  /** Returns the Q-values [2, A] of two observations: a state of two takes half the time of one alone. */
  #pair(one, other) {
    let [features, inputs] = [Float32Array.of(...one, ...other), one.length];
    for (const { kernel, bias, activate, sums, output } of this.layers) {
      const units = bias.length;
      sums.set(bias);
      sums.set(bias, units);
      addProduct(sums, features, inputs, 1, kernel, 2, inputs, units);
      for (let j = 0; j < 2 * units; j++) output[j] = activate(Math.fround(sums[j]));
      [features, inputs] = [output, units];
    }
    return features;
  }
}

/** Returns the bytes of a text in base64. */
function decodedBytes(text) {
  return Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
}

/** Returns the numbers of a text in base64 of float32. */
function decodedFloats(text) {
  const { buffer } = decodedBytes(text);
  if (buffer.byteLength % 4) throw new Error("its weights are cut off");
  return new Float32Array(buffer); // little-endian, like every machine with a browser
}

/** Returns the numbers of a text in base64 of float16, which not every browser has an array for. */
function decodedHalves(text) {
  return Float32Array.from(new Uint16Array(decodedBytes(text).buffer), (bits) => {
    const [sign, exponent, fraction] = [bits >> 15 ? -1 : 1, (bits >> 10) & 31, bits & 1023];
    if (exponent === 0) return sign * fraction * 2 ** -24;
    return sign * (1024 + fraction) * 2 ** (exponent - 25);
  });
}

/** Returns the index of the highest value from `start` to `end`, the lowest index among equal ones. */
function argmax(values, start = 0, end = values.length) {
  let best = start;
  for (let i = start + 1; i < end; i++) {
    if (values[i] > values[best]) best = i;
  }
  return best;
}
