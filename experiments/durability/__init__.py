"""Parts of ``experiments/kill_campaign.py``."""
