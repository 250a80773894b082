"""The wedge brake's drive train: what its rigs measure of screws, bearings and motors."""
