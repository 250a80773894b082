"""The exported ECU on other processors: compiled for them, run by an emulator, measured."""
