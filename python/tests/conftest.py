import pytest
from simulators import BOWL, bowl

import pitchline


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """The results of the campaign."""
    folder = tmp_path_factory.mktemp("bowl")
    campaign = pitchline.Campaign(BOWL, simulator=bowl)
    return campaign.run(folder / "bowl.db", out=folder / "report", progress=False)
