"""What was found in signals, and what was done to bring them to one time axis."""

from __future__ import annotations

from dataclasses import dataclass

from bywire.data.channel_quality import ChannelQuality

_FASTER = 0.01  # clocks of the same nominal rate differ by less


@dataclass(frozen=True)
class AlignedChannel:
    """What was found in a channel, and what was done with it.

    Parameters
    ----------
    name
        Name of the signal.
    quality
        What it is like.
    delay
        By how much its instants had been moved back [s].
    excluded
        Number of samples of the common axis that are NaN because of its flaws.
    """

    name: str
    quality: ChannelQuality
    delay: float
    excluded: int


@dataclass(frozen=True)
class AlignmentReport:
    """What was done to bring signals to one time axis.

    Parameters
    ----------
    interval
        Step of the common axis [s].
    start, stop
        Its first and last instant [s].
    samples
        How many there are.
    method
        How values between samples were found.
    exclude
        Which flaws were excluded; the others were used.
    channels
        What was found and done, for each signal.
    """

    interval: float
    start: float
    stop: float
    samples: int
    method: str
    exclude: tuple[str, ...]
    channels: tuple[AlignedChannel, ...]

    @property
    def folded(self) -> tuple[str, ...]:
        """Signals that are faster than the axis, so that their fast content folds into slow."""
        if self.method == "average":
            return ()
        limit = (1.0 + _FASTER) / self.interval
        return tuple(channel.name for channel in self.channels if channel.quality.rate > limit)
