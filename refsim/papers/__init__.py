"""The papers' tracers, each a short list of draws on `refsim.pipeline`."""
