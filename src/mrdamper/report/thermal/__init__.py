"""Reports on heating: heat, sink, forecast, observe, and how all of them say when a limit is reached."""
