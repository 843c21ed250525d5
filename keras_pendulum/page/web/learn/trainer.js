"use strict";

/** Returns ε of the next step from the episode's index and the steps since the start of the run. */
const EPSILON_SCHEDULES = {
  episodes: ({ epsilon_start: start, epsilon_decay: decay, epsilon_min: lowest }, episode) =>
    Math.max(lowest, start * decay ** (episode + 1)),
  steps: ({ epsilon_start: start, epsilon_decay_steps: steps, epsilon_min: lowest }, episode, before) =>
    lowest + (start - lowest) * Math.exp(-before / steps),
};

// The index in the replay buffer for an action; `truncated` is a fault of the walkthrough.
const STORED_INDICES = {
  exact: (action) => action,
  truncated: (action) => Math.trunc((action / 10 - 2 + 2) * 10),
};

/** A run of the DQN agent: episodes, their transitions, and the updates between them. */
class Trainer {
  /**
   * @param {Task} task
   * @param {object} settings by the names of the Config, and the settings that are faults, see
   *   page/learning.py.
   * @param {number} actionCount how many outputs the network has.
   */
  constructor(task, settings, actionCount) {
    const source = (stream) => new Random(settings.seed, stream);
    Object.assign(this, { task, settings });
    this.efforts = task.efforts(actionCount);
    this.exploration = source(1);
    this.replaySource = source(2);
    const observation = task.observed(task.randomStart());
    this.network = new LearningNetwork(
      [observation.length, ...settings.hidden_units, actionCount],
      settings.activation,
    );
    this.network.initialize(settings.initial_weights, source(0));
    this.learner = new Learner(this.network, settings);
    this.replay = new ReplayBuffer(settings.replay_capacity, settings.batch_size, observation.length);
    this.episode = 0; // the next one
    this.visits = new Float32Array(LEARNED_MAP_SIZE ** 2); // of each cell of the map
    this.path = []; // of the last episode
  }

  get isFinished() {
    return this.episode >= this.settings.episodes;
  }

  /** Plays one episode and makes its updates; returns its record. */
  trainEpisode() {
    const { settings, episode, task } = this;
    let state = task.randomStart();
    let [total, epsilon, over] = [0, 0, false];
    const losses = [];
    this.path = [state];
    for (let step = 1; step <= settings.max_episode_steps && !over; step++) {
      epsilon = EPSILON_SCHEDULES[settings.epsilon_schedule](settings, episode, this.replay.added);
      const action = this.#action(state, epsilon);
      const next = task.advanced(state, this.efforts[action]);
      over = next.over;
      this.#store(state, action, next, step);
      total += next.reward;
      state = next.state;
      this.path.push(state);
      if (settings.train_frequency === "step") this.#update(1, losses);
    }
    if (settings.train_frequency === "episode" && episode >= settings.warmup_episodes) {
      this.#update(settings.updates_per_episode, losses);
    }
    this.episode += 1;
    if (this.isFinished) this.learner.optimizer.averageWeights(this.network.weights);
    return {
      episode,
      steps: this.path.length - 1,
      episodeReturn: total,
      epsilon,
      loss: losses.length ? losses.reduce((a, b) => a + b) / losses.length : null,
      updates: this.learner.optimizer.updates,
    };
  }

  #action(state, epsilon) {
    if (this.exploration.next() <= epsilon) return this.exploration.below(this.efforts.length);
    return argmax(this.network.qValues(this.task.observed(state)));
  }

  #store(state, action, { state: next, reward, over }, step) {
    const { settings, task } = this;
    const isLast = over || step === settings.max_episode_steps;
    this.visits[learnedCell(task, state)] += 1;
    this.replay.add(
      task.observed(state),
      STORED_INDICES[settings.stored_index](action),
      settings.reward_factor * settings.reward_scale * reward,
      task.observed(next),
      settings.stored_end === "over" ? isLast : over,
    );
  }

  /** Makes updates, and adds their losses to the list. */
  #update(count, losses) {
    if (this.replay.length < this.settings.batch_size) return;
    for (let i = 0; i < count; i++) {
      const loss = this.learner.update(this.replay.sample(this.replaySource));
      if (!Number.isFinite(loss)) throw new Error("the loss is not finite: learning has diverged");
      losses.push(loss);
    }
  }
}
