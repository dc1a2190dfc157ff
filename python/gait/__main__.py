"""Run the ``gait`` command as ``python -m gait``."""

import sys

from gait.cli import main

sys.exit(main())
