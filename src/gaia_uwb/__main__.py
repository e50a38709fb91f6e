"""``python -m gaia_uwb`` is the command ``gaia``."""

from gaia_uwb.cli import main

main()
