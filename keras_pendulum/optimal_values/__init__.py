"""The best possible returns that `keras_pendulum.optimum` made and reads."""
