"""How right a setting is and what it costs: trials, forecasts, choices, certificates, and their bench."""
