"""Runnable studies: each file has its question, its configs, its figure and what it is held against."""
