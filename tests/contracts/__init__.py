"""What every element of ``bywire.plant`` and ``bywire.control`` must keep, whoever wrote it."""
