"""What makes this project's own tables and figures, and the studies behind them; nothing but `reproduce` needs it."""
