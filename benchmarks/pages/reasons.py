"""Why each preset departs from the earlier one, setting by setting.

`python -m benchmarks.tables` puts these words beside the measured regrets in docs/presets.md.
"""

from __future__ import annotations

REASONS: dict[str, dict[str, str]] = {
    "reference": {
        "max_episode_steps": "the rest of an episode only balances; shorter episodes show the way "
        "up more often",
        "replay_capacity": "a small buffer holds the last episodes only; near the end almost all "
        "of them show balancing, and the network forgets how to swing up",
        "updates_per_episode": "one update per episode does not spread the values from the upright "
        "position (`update-starvation`)",
        "learning_rate_schedule": "with a constant rate the policy jumps between good and bad "
        "until the last episode; with the cosine it settles",
        "target_update": "removes `no-target-network`; with the other changes it gains little on "
        "this task, because γ and the cosine already keep the values stable",
    },
    "swingup": {
        "episodes": "shorter episodes, so more of them",
        "max_episode_steps": "most regret arises in the first 20 steps; so many longer "
        "episodes take more time",
        "initial_weights": "more and sharper features near hanging, where a wrong side costs most",
        "batch_size": "smaller gradient noise, where returns differ by hundreds",
        "discount": "the γ of `reference` does not look far enough ahead to reach from a swing to "
        "the top",
        "reward_scale": "about 1 - γ: then the values are about as large as one reward, which "
        "suits Adam's step",
        "epsilon_decay": "exploration lasts longer, because the run has more episodes; it gained "
        "more with the training seeds on which the settings were chosen",
        "epsilon_min": "at the end the buffer then holds only what the policy meets; the network "
        "fits that more closely",
        "updates_per_episode": "as many after such short episodes take more than twice the time "
        "and gain nothing",
        "learning_rate_min": "weights that still move a little have a better average",
        "average_updates": "the values change with each update, by more than the difference of two "
        "torques near hanging; their average does not",
    },
    "cartpole": {
        "reward_scale": "1 - γ: then the values are about as large as one reward, which suits "
        "Adam's step",
        "epsilon_min": "random actions bring the cart near the ends of its track; without them "
        "the network does not learn that a slow drift ends there",
        "train_frequency": "one compiled call makes all updates of an episode; without it the "
        "learning rate is constant too",
        "learning_rate": "40 updates after an episode are too few for the smaller one",
        "learning_rate_schedule": "with a constant rate the policy jumps until the last episode, "
        "which its average mostly hides",
        "learning_rate_min": "weights that still move a little have a better average",
        "tau": "the target network follows faster, because there are fewer updates",
        "average_updates": "the last update may leave a policy that drifts off the track; the "
        "average of the weights does not",
    },
}
