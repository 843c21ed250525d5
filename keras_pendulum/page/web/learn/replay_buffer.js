"use strict";

/** Transitions in arrays of one layout: of the replay buffer, and of a batch. */
class Transitions {
  /** `Floats` is the class of the observations. A batch has the class of the weights, which is faster. */
  constructor(count, observationSize, Floats) {
    this.observations = new Floats(count * observationSize);
    this.actions = new Int32Array(count);
    this.rewards = new Float32Array(count);
    this.nextObservations = new Floats(count * observationSize);
    this.ended = new Uint8Array(count); // 0 for a truncated episode
  }
}

/** A ring of the last `capacity` transitions. */
class ReplayBuffer {
  constructor(capacity, batchSize, observationSize) {
    Object.assign(this, { capacity, observationSize });
    this.added = 0; // transitions since the start of the run
    this.stored = new Transitions(capacity, observationSize, Float32Array);
    this.batch = new Transitions(batchSize, observationSize, Float64Array);
    this.places = new Uint32Array(batchSize);
  }

  get length() {
    return Math.min(this.added, this.capacity);
  }

  /** Stores a transition, in place of the oldest when full. */
  add(observation, action, reward, nextObservation, ended) {
    const { stored, observationSize } = this;
    const place = this.added % this.capacity;
    stored.observations.set(observation, place * observationSize);
    stored.actions[place] = action;
    stored.rewards[place] = reward;
    stored.nextObservations.set(nextObservation, place * observationSize);
    stored.ended[place] = ended;
    this.added += 1;
  }

  /** Returns a batch, drawn without replacement; the next call overwrites it. */
  sample(random) {
    const { stored, batch, places, observationSize: size } = this;
    random.draw(places, this.length);
    places.forEach((place, row) => {
      for (let i = 0; i < size; i++) {
        batch.observations[row * size + i] = stored.observations[place * size + i];
        batch.nextObservations[row * size + i] = stored.nextObservations[place * size + i];
      }
      batch.actions[row] = stored.actions[place];
      batch.rewards[row] = stored.rewards[place];
      batch.ended[row] = stored.ended[place];
    });
    return batch;
  }
}
