"""The pages of `bywire serve`, one file each, in one frame."""
