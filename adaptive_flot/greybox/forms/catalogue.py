"""Forms of an effect: how a quantity at a site answers to its driver.

Each form is a *family* whose shape is free (its coefficients), and each is nothing at its default coefficients:
`exp(0) = 1` and `+ 0` are exact, so a model with an effect of amplitude zero is the nominal model to the bit.
"""

from collections.abc import Mapping

from adaptive_flot.greybox.forms.direct import DIRECT_FORMS
from adaptive_flot.greybox.forms.faults import FAULT_FORMS
from adaptive_flot.greybox.forms.form import Form
from adaptive_flot.greybox.forms.lagging import LAGGING_FORMS
from adaptive_flot.greybox.forms.relay import RELAY_FORMS
from adaptive_flot.greybox.forms.static import STATIC_FORMS

_ALL = (*STATIC_FORMS, *DIRECT_FORMS, *LAGGING_FORMS, *FAULT_FORMS, *RELAY_FORMS)
FORMS: Mapping[str, Form] = {form.name: form for form in _ALL}
