"""Fleet files as units and manifests for engines that exist: systemd, Quadlet, Compose, Kubernetes, Nomad."""
