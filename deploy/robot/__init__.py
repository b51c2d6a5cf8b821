"""A real robot's driver: it speaks the hardware topics and embeds the gateway, as the simulated world does."""
