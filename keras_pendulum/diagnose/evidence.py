"""A finding, and the evidence that the rules look at."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from keras_pendulum.diagnose import comparisons
from keras_pendulum.diagnose.comparisons import ActionMatch, Match
from keras_pendulum.diagnose.measurement import Measurement
from keras_pendulum.diagnose.repairs import Repair
from keras_pendulum.diagnose.run_record import RunRecord
from keras_pendulum.diagnose.texts import PAGE, TEXTS


@dataclass(frozen=True)
class Finding:
    """A fault that the evidence shows."""

    name: str
    evidence: str
    healthy: str  # the same figure of a healthy network
    repair: Repair | None = None  # without training, where there is one
    cost: float | None = None  # in return, where a repair shows it

    @property
    def explanation(self) -> str:
        """Two sentences on the fault."""
        return TEXTS[self.name].explanation

    @property
    def remedy(self) -> str:
        """Returns what to do."""
        return TEXTS[self.name].remedy

    @property
    def page(self) -> str:
        """The section of the docs."""
        return f"{PAGE}#{self.name}"

    def as_json(self) -> dict[str, Any]:
        """Returns the finding as an object of JSON."""
        return {
            "name": self.name,
            "evidence": self.evidence,
            "healthy": self.healthy,
            "cost": self.cost,
            "repair": self.repair.name if self.repair else None,
            "explanation": self.explanation,
            "remedy": self.remedy,
            "page": self.page,
        }


@dataclass(frozen=True)
class Evidence:
    """The measurement, its matches, and the run's record if there is one."""

    measurement: Measurement
    record: RunRecord | None = None

    @cached_property
    def declared(self) -> Match:
        """The match with the declared task."""
        return comparisons.match(self.measurement.learned_q, self.measurement.exact_q)

    @cached_property
    def rewards(self) -> Match:
        """The match with the rewards of one step."""
        measurement = self.measurement
        return comparisons.match(measurement.learned_q, comparisons.reward_q(measurement))

    @cached_property
    def observation(self) -> tuple[str, Match]:
        """The change of the observation that matches best."""
        matches = comparisons.match_observations(self.measurement)
        return max(matches.items(), key=lambda item: item[1].scaled_score)

    @cached_property
    def actions(self) -> ActionMatch | None:
        """The match with the stored actions; None without 200 of them."""
        if self.record is None or len(self.record.replay.action) < 200:
            return None
        return comparisons.match_actions(self.measurement, self.record.replay)

    @cached_property
    def lost_actions(self) -> list[int]:
        """The actions that acted, but were stored as others; none without 200 transitions."""
        torques = self.measurement.subject.torques
        if self.record is None or torques is None or len(self.record.replay.action) < 200:
            return []
        lost = self.record.lost_actions(torques)
        return lost if len(lost) < len(torques) / 2 else []

    def repaired(self, name: str, evidence: str, healthy: str, repair: Repair) -> Finding:
        """Returns a finding with what its repair wins."""
        cost = self.measurement.regret - repair.regret
        return Finding(name, evidence, healthy, repair, cost)
