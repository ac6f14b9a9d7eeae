"""Write results as text: tables for people; JSON, CSV and Markdown for programs. The modules here print nothing."""
