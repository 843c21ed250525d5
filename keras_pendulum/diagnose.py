"""The command `python -m keras_pendulum.diagnose`; its code is in the room `diagnosis`."""

# PYTHON_ARGCOMPLETE_OK
import sys

from keras_pendulum.diagnosis.__main__ import main

if __name__ == "keras_pendulum.diagnose":
    # An imported module would hide the function of the same name.
    raise ImportError("keras_pendulum.diagnose is a command: from keras_pendulum import diagnose")
if __name__ == "__main__":
    sys.exit(main())
