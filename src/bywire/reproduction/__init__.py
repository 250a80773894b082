"""Published sources reproduced: what each states beside what we compute, one file per source."""
