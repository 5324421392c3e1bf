"""What a reader met in a recording and did not hide: a count, a place and a sentence each."""

from __future__ import annotations

from dataclasses import dataclass

KINDS = (
    "damage",  # the file itself: cut, checksum, metadata that do not fit
    "skipped",  # channels that cannot be used, with the reason
    "undecodable",  # messages that are not what their type says
    "joint",  # other joints on the topic, or a joint of another name
    "publishers",  # several of one joint, of which one was chosen
    "covariance",  # data that are declared as not measured
    "clock",  # stamps of another clock
    "missing_stamp",
    "reversed_time",
    "restart",  # time jumps back to an earlier run
    "duplicate",
    "gap",
    "jitter",
    "not_a_number",
    "clipping",
    "constant",
    "unit",  # a size that suggests another unit
    "resampled",
    "idle",  # the command was recorded but did not act
    "absent",  # an optional signal that is not there or not usable
)


@dataclass(frozen=True)
class Finding:
    """One kind of trouble on one topic.

    Attributes
    ----------
    kind : one of `KINDS`.
    topic : full topic name, empty where the whole recording is meant.
    count : how many samples, messages or places.
    text : the sentence for a person, with the first place where it happens.
    time : first place, seconds from the first sample [s]; None where it has none.
    """

    kind: str
    topic: str
    count: int
    text: str
    time: float | None = None

    def __str__(self) -> str:
        return f"{self.topic}: {self.text}" if self.topic else self.text
