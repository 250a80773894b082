"""The keys that tell kinds of files apart are those of the readers."""

from __future__ import annotations

from bywire.campaigns import campaign_file
from bywire.data import toml_file
from bywire.data.toml_file import CAMPAIGN, HEADS, LIFE, STUDY
from bywire.life import life_file
from bywire.studies import study_file

KEYS = {
    STUDY: {*study_file.StudyFile.model_fields},
    CAMPAIGN: {*campaign_file.CampaignFile.model_fields},
    LIFE: {*life_file.LifeFile.model_fields},
}


def test_keys_of_studies_and_of_campaigns_alone_are_known():
    """One that a reader newly takes, and that the list here does not have, would mistake files."""
    assert KEYS[CAMPAIGN] - KEYS[STUDY] == toml_file._NEVER_IN_STUDIES
    assert KEYS[STUDY] - KEYS[CAMPAIGN] == toml_file._NEVER_IN_CAMPAIGNS


def test_readers_know_what_their_files_cannot_do_without():
    assert {kind: HEADS[kind] in keys for kind, keys in KEYS.items()} == dict.fromkeys(KEYS, True)
    assert [kind for kind, keys in KEYS.items() if HEADS[LIFE] in keys] == [LIFE]
