"use strict";

/**
 * A seeded source of random numbers: xoshiro128++ (Blackman & Vigna 2019), its state filled by
 * splitmix32. `stream` makes independent sources of one seed.
 */
class Random {
  constructor(seed, stream = 0) {
    let mixed = (seed ^ Math.imul(stream + 1, 0x9e3779b1)) >>> 0;
    this.words = Uint32Array.from({ length: 4 }, () => {
      mixed = (mixed + 0x9e3779b9) >>> 0;
      let word = mixed;
      word = Math.imul(word ^ (word >>> 16), 0x21f0aaad);
      word = Math.imul(word ^ (word >>> 15), 0x735a2d97);
      return (word ^ (word >>> 15)) >>> 0;
    });
  }

  /** Returns a number from 0 to 1, without 1. */
  next() {
    const words = this.words;
    const turned = (word, bits) => (word << bits) | (word >>> (32 - bits));
    const result = (turned((words[0] + words[3]) | 0, 7) + words[0]) >>> 0;
    const shifted = words[1] << 9;
    words[2] ^= words[0];
    words[3] ^= words[1];
    words[1] ^= words[2];
    words[0] ^= words[3];
    words[2] ^= shifted;
    words[3] = turned(words[3], 11);
    return result / 2 ** 32;
  }

  /** Returns a whole number below `count`. */
  below(count) {
    return Math.floor(this.next() * count);
  }

  /** Returns a number within ±limit. */
  within(limit) {
    return (2 * this.next() - 1) * limit;
  }

  /** Fills `places` with different whole numbers below `count`. */
  draw(places, count) {
    const drawn = new Set();
    while (drawn.size < places.length) drawn.add(this.below(count));
    places.set([...drawn]);
  }
}
