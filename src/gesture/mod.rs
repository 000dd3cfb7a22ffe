//! Gestures: definition from one example, planes, wave estimators.
