import sys

from rebound_cli.main import main

sys.exit(main())
