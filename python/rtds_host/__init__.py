"""Host side of the real-time digital simulator of a differential-drive robot's motors."""

__version__ = "0.1.0"
