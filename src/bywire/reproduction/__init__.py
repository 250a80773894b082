"""Published sources reproduced: statements against our results, one file per source."""
