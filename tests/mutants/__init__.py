"""One token of a valid spec is changed: is that found, and how near?"""
