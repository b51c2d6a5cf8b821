"""State of a running fleet as OpenMetrics text over HTTP, and a Grafana dashboard for it."""
