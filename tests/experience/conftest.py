"""Makes the module `fake_reach` importable, here and in worker processes that unpickle it."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
