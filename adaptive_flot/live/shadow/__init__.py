"""In shadow: other estimators, controllers and models on the same samples. Nothing here can write to the plant.

Map
---
worker.py      What runs in the process of a shadow: estimator and controller on the samples that it is sent.
process.py     A shadow seen from the link: started, fed, listened to, never waited for.
comparison.py  One-step errors of a shadow and of the acting estimator on the same rows.
"""
