"""From the residual between a model and a measured record to the physical effect that the model lacks.

`discover.discover` is the entry. `discover.STAGES` lists its stages in order; each takes a `results.State` and returns
one that knows more, or ends the search with a `results.Verdict`.

Map, in the order in which a record passes through it; each entry imports only those above it
----------------------------------------------------------------------------------------------
record/       The record as discovery sees it: screening, splits, measured outputs, noise.
fitting/      Fits of one alternative: unknowns, descent, likelihood, many at once.
candidates/   What could be missing: catalogue, first-order responses, the score test, step events, curves.
results/      What the stages come to, as plain data: everything else may read it.
assessment/   What a fit is worth: residual tests, verification on rows to which nothing was fitted.
search/       Which combination it is: successive halving, rounds, joint search, common nuisance.
background/   What is always a little wrong: a feed that wanders, constants. It is then a part of every fit.
test_design/  Which input moves would tell the leading alternatives apart.
verdict/      The word, its reasons, and how they are put.
further_sites/  What acts where a model has no site: it competes with every cause since a reference, and with events.
hypotheses/   Named hypotheses about several records: what has changed since a reference.
innovations/  A second opinion with process noise: when something happened, and what it may be.
discover.py   What is called for one record: the stages, one after the other.
later_inputs.py  Whether inputs act one row later than a record says.
stages.py     The stages, from the data to the proposed test.
fallbacks.py  What is still told where the whole is not: a course, or a part.
since_reference/  What has changed since a reference, events too.

Where a statistic is computed
-----------------------------
score statistic            candidates/score_test.py   Scorer
null law of the search     candidates/score_test.py   Scorer.null_gains
likelihood, BIC            fitting/fit.py             loss_of, Fit.bic
noise model                record/noise.py            fit_noise
marginal likelihood        background/evidence.py     Evidence, fitting/fit.py
effective sample size      record/effective_samples.py  correlation_times
Ljung-Box, Holm            assessment/detect.py       detect
block bootstrap            assessment/reduction.py    reduction
sd of a loglik difference  assessment/likelihood.py   loglik_difference_sds
backward elimination       candidates/knots.py        trimmed
cross-validation           search/joint_fits.py       cross_validated
separation of two models   test_design/separation.py  separation

Glossary
--------
site           A named quantity inside the model at which an effect may act.
driver         What the effect depends on there: a signal, time, or nothing (a constant).
effect         A term at a site, with a driver and a form (power law, curve, ramp ...).
candidate      A site with a driver, before any fit; its variants are the forms that are scored.
alternative    The model with one or more effects, fitted.
base           The model without any effect, fitted.
gain           Drop of minus two log-likelihood.
criterion      The Bayesian information criterion (BIC); smaller is better.
split          A part of the record: rows to estimate, rows to confirm, rows to report.
time profile   What happens at a site over the record, before its size is known.
response       What the measured outputs do after a small time profile at a site.
linearisation  The responses along one fitted run.
rung           A round of successive halving: many candidates with few steps, or few to the end.
common nuisance  What all leading alternatives lack; it is added to each before they are compared.
screening      Measurements that can not be used, and records that say too little.
"""
