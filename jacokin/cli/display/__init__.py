"""What is shown: tables for people, JSON for programs, progress."""
