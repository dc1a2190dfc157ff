"""``python -m gait`` is the ``gait`` command."""

import sys

from gait.cli import main

sys.exit(main())
