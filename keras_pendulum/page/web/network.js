"use strict";

// Each function `apply` changes the first numbers of an array; each slope is that of a value after it.
const ACTIVATIONS = {
  tanh: {
    apply: (values, end) => {
      for (let i = 0; i < end; i++) values[i] = 1 - 2 / (Math.exp(2 * values[i]) + 1);
    },
    slope: (value) => 1 - value * value,
  },
  relu: {
    apply: (values, end) => {
      for (let i = 0; i < end; i++) if (!(values[i] > 0)) values[i] = 0;
    },
    slope: (value) => (value > 0 ? 1 : 0),
  },
  linear: { apply: () => {}, slope: () => 1 },
};

/** A Q-network: dense layers with activations, then a linear output for each action. */
class DenseNetwork {
  /**
   * @param {number[]} sizes of all layers, the observation's first.
   * @param {string} activation one for all hidden layers, or one for each, separated by commas.
   * @param {Float32Array|Float64Array} weights kernel [in, out] and bias [out] of each layer in order.
   */
  constructor(sizes, activation, weights) {
    if (weights.length !== countWeights(sizes)) {
      throw new Error(`it contains ${weights.length} weights; expected ${countWeights(sizes)}`);
    }
    Object.assign(this, { sizes, weights });
    let start = 0;
    const taken = (count) => weights.subarray(start, (start += count));
    const activations = activation.split(",").map((name) => ACTIVATIONS[name]);
    this.layers = sizes.slice(1).map((units, i) => ({
      inputs: sizes[i],
      units,
      kernels: taken(sizes[i] * units),
      biases: taken(units),
      activation: activations[i] ?? activations[0],
    }));
    this.reserve(1);
  }

  /** Returns the Q-values [rows, A] of observations [rows, D]; the next call overwrites the array. */
  qValues(observations, rows = 1) {
    const features = this.hidden(observations, rows);
    return this.#products(this.layers.length - 1, features, rows).subarray(0, rows * this.sizes.at(-1));
  }

  /** Returns the outputs [rows, units] of the last hidden layer. */
  hidden(observations, rows) {
    if (rows > this.rows) this.reserve(rows);
    let features = observations;
    for (let i = 0; i < this.layers.length - 1; i++) {
      const { activation, units } = this.layers[i];
      features = this.#products(i, features, rows);
      activation.apply(features, rows * units);
    }
    return features;
  }

  #products(i, features, rows) {
    const { kernels, biases, inputs, units } = this.layers[i];
    const output = this.outputs[i];
    for (let row = 0; row < rows; row++) output.set(biases, row * units);
    addProduct(output, features, inputs, 1, kernels, rows, inputs, units);
    return output;
  }

  reserve(rows) {
    this.rows = rows;
    this.outputs = this.layers.map(({ units }) => new Float64Array(rows * units));
  }
}

/** Returns the number of weights of dense layers. */
function countWeights(sizes) {
  return sizes.slice(1).reduce((sum, units, i) => sum + (sizes[i] + 1) * units, 0);
}

/** The Q-network of a weights file, and its greedy policy. */
class Network extends DenseNetwork {
  /**
   * @param {{sizes: number[], activation: string}} recorded see `DenseNetwork`.
   * @param {Float32Array} numbers the weights.
   * @param {Task} task
   */
  constructor({ sizes, activation }, numbers, task) {
    super(sizes, activation, numbers);
    this.task = task;
    this.efforts = task.efforts(sizes.at(-1));
  }

  /** Returns the greedy effort. */
  effort(state) {
    return this.effortsOf([state])[0];
  }

  /** Returns the greedy effort of each state; two states take as long as one. */
  effortsOf(states) {
    const { task, efforts } = this;
    const observations = Float32Array.from(states.flatMap((state) => [...task.observed(state)]));
    const values = this.qValues(observations, states.length);
    const { length } = efforts;
    return states.map((_, i) => efforts[argmax(values, i * length, (i + 1) * length) - i * length]);
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
