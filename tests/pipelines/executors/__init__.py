"""The mirror of pipelines.executors."""
