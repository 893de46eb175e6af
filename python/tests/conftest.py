import hypothesis
import pytest
from simulators import BOWL, bowl

import pitchline

# A busy machine is no failure.
hypothesis.settings.register_profile("any-machine", deadline=None)
hypothesis.settings.load_profile("any-machine")


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """The results of the campaign."""
    folder = tmp_path_factory.mktemp("bowl")
    campaign = pitchline.Campaign(BOWL, simulator=bowl)
    return campaign.run(folder / "bowl.db", out=folder / "report", progress=False)
