"""Networks of Keras 2 and Keras 3, and the files that both versions save of them.

Either version of Keras builds each network. Weights and biases are random, so that two layers of
one shape differ. No file of any network may load as another network. `keras_files` loads all of
them, tests/storage/test_files_of_keras.py some.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

Keras = Any  # the module keras or tf_keras
Build = Callable[[Keras], Any]  # returns a layer or a model
Rule = Literal["loads", "refused", "either", "untested"]
# What determines the order of the layers in a file of weights alone, and what shows that the
# network is no chain of Dense layers:
#   shapes       only one order fits
#   functional   Keras saves the layers of a functional model in their order
#   sequential   so it does for a Sequential; but in a `.weights.h5` of Keras 2 a Sequential
#                looks like a subclassed model
#   unknown      the file may be refused
#   classes      a `.weights.h5` names the class of a layer that is not Dense
#   arrays       a layer has other arrays than a kernel and a bias
Order = Literal["shapes", "functional", "sequential", "unknown", "classes", "arrays", "untested"]


@dataclass(frozen=True)
class Network:
    """A network and the rules for its files.

    Args:
        build: returns the model, built by the module `keras` or `tf_keras`.
        order: of the layers in a file of weights alone.
        whole: the rule for `.keras`, and for the `.h5` of `model.save`.
        blamed: names of layers; a refusal of a whole file names one of them.
        activation: of all hidden layers. A file of weights alone is loaded with it.
        versions: of Keras, which can build this network.
        inputs: the size of an observation.
    """

    build: Build
    order: Order = "shapes"
    whole: Rule = "loads"
    blamed: tuple[str, ...] = ()
    activation: str = "tanh"
    versions: tuple[int, ...] = (2, 3)
    inputs: int = 3

    def model(self, keras: Keras) -> Any:
        """Returns the model with random weights."""
        model = self.build(keras)
        random = np.random.default_rng(0)
        for each in model.layers:
            each.set_weights([_random(random, array) for array in each.get_weights()])
        return model

    def rule(self, name: str, version: int) -> Rule:
        """Returns the rule for a file that `saved_files` yields."""
        if name in WHOLE:
            return self.whole
        in_container = name == "model.weights.h5"
        rules: dict[Order, Rule] = {
            "shapes": "loads",
            "functional": "loads",
            "sequential": "either" if in_container and version == 2 else "loads",
            "unknown": "either",
            "classes": "refused" if in_container else "untested",
            "arrays": "refused",
            "untested": "untested",
        }
        return rules[self.order]


def _random(random: np.random.Generator, array: Any) -> Any:
    scale = float(np.prod(array.shape[:-1])) ** -0.5
    return np.asarray(random.normal(size=array.shape) * scale, array.dtype)


WHOLE = ("model.h5", "model.keras")
WEIGHTS = ("model.weights.h5", "weights_alone.h5")  # Keras 2 saves both, Keras 3 only the first


def saved_files(model: Any, version: int, names: Sequence[str], folder: Path) -> Iterator[Path]:
    """Saves the model of a version of Keras under each name that it accepts; yields the paths."""
    for name in names:
        path = folder / name
        if name == "weights_alone.h5" and version == 3:
            continue
        # Keras 2 saves no subclassed model as one `.h5`.
        with contextlib.suppress(NotImplementedError):
            (model.save if name in WHOLE else model.save_weights)(str(path))
            yield path


def layer(kind: str, *arguments: Any, **options: Any) -> Build:
    """Returns a layer of a class of Keras."""
    return lambda keras: getattr(keras.layers, kind)(*arguments, **options)


def dense(units: int, activation: Any = "tanh", **options: Any) -> Build:
    """Returns a Dense layer."""
    return layer("Dense", units, activation, **options)


HEAD = dense(5, None)
DROPOUT = layer("Dropout", 0.5)
EQUAL = (dense(8), dense(8), dense(8))


def activation(name: str) -> Build:
    """Returns an Activation layer."""
    return layer("Activation", name)


def named(*names: str, units: int = 8, activation: str = "tanh") -> tuple[Build, ...]:
    """Returns Dense layers with these names, the last one as head."""
    hidden = [dense(units, activation, name=name) for name in names[:-1]]
    return (*hidden, dense(5, None, name=names[-1]))


def sequential(*layers: Build, inputs: int = 3) -> Build:
    """Returns a Sequential."""
    return lambda keras: keras.Sequential(
        [keras.Input((inputs,)), *(build(keras) for build in layers)]
    )


def without_input(*layers: Build) -> Build:
    """Returns a Sequential that only its first call builds."""

    def build(keras: Keras) -> Any:
        model = keras.Sequential([build(keras) for build in layers])
        model(np.zeros((1, 3), np.float32))
        return model

    return build


def functional(*layers: Build, created: Sequence[int] | None = None) -> Build:
    """Returns a chain of the layers in their order, which are created in the order `created`."""

    def build(keras: Keras) -> Any:
        order = range(len(layers)) if created is None else created
        chain = dict(sorted((i, layers[i](keras)) for i in order))
        inputs = outputs = keras.Input((3,))
        for i in range(len(layers)):
            outputs = chain[i](outputs)
        return keras.Model(inputs, outputs)

    return build


def graph(connect: Callable[[Keras, Any], Any]) -> Build:
    """Returns a functional model of `connect(keras, inputs)`."""

    def build(keras: Keras) -> Any:
        inputs = keras.Input((3,))
        return keras.Model(inputs, connect(keras, inputs))

    return build


def subclassed(
    attributes: Mapping[str, Build | list[Build] | dict[str, Build]],
    calls: Sequence[str] | None = None,
    *,
    backwards: bool = False,
    prebuilt: bool = False,
) -> Build:
    """Returns a subclassed model.

    Args:
        attributes: layers, or lists or dictionaries of layers, in the order of assignment.
        calls: the attributes in the order of calls; without it that of assignment.
        backwards: whether a list is called from its end.
        prebuilt: whether `layer.build` creates the weights, as in this package's DQN.
    """

    def build(keras: Keras) -> Any:
        def made(value: Any) -> Any:
            if isinstance(value, dict):
                return {key: entry(keras) for key, entry in value.items()}
            return [entry(keras) for entry in value] if isinstance(value, list) else value(keras)

        class Net(keras.Model):
            def __init__(self) -> None:
                super().__init__()
                for name, value in attributes.items():
                    setattr(self, name, made(value))

            def chain(self) -> Iterator[Any]:
                for name in calls or attributes:
                    value = getattr(self, name)
                    if hasattr(value, "values"):
                        yield from value.values()
                    elif callable(value):
                        yield value
                    else:
                        yield from list(value)[:: -1 if backwards else 1]

            def call(self, inputs: Any) -> Any:
                for each in self.chain():
                    inputs = each(inputs)
                return inputs

        model = Net()
        if prebuilt:
            shape: tuple[int | None, int] = (None, 3)
            for each in model.chain():
                each.build(shape)
                shape = (None, each.units)
        model(np.zeros((1, 3), np.float32))
        return model

    return build


def compiled(
    build: Build, optimizer: str = "adam", *, train: bool = True, metrics: Sequence[str] = ()
) -> Build:
    """Returns the model of `build`, compiled and with `train` trained by one update."""

    def build_and_train(keras: Keras) -> Any:
        model = build(keras)
        model.compile(optimizer, "mse", metrics=list(metrics), run_eagerly=True)  # starts fast
        if train:
            model.train_on_batch(np.ones((4, 3), np.float32), np.ones((4, 5), np.float32))
        return model

    return build_and_train


def custom_dense(keras: Keras) -> Any:
    """Returns a layer of a class that Keras does not know, which doubles what Dense returns."""

    class Doubled(keras.layers.Dense):
        def call(self, inputs: Any) -> Any:
            return 2 * keras.layers.Dense.call(self, inputs)

    return Doubled(8, "tanh", name="odd")


def _own_activation(keras: Keras) -> Any:
    return keras.layers.Dense(8, _doubled, name="odd")


def _doubled(features: Any) -> Any:
    return 2 * features


def _sequential_subclass(keras: Keras) -> Any:
    class Stack(keras.Sequential):
        pass

    return Stack([keras.Input((3,)), *(build(keras) for build in (*EQUAL, HEAD))])


def _functional_subclass(keras: Keras) -> Any:
    class Stack(keras.Model):
        def __init__(self) -> None:
            inputs = outputs = keras.Input((3,))
            layers = [build(keras) for build in (*EQUAL, HEAD)]
            for each in layers:
                outputs = each(outputs)
            super().__init__(inputs=inputs, outputs=outputs)
            self.aside = layers[2]

    return Stack()


def part_of_another(keras: Keras) -> Any:
    """Returns the first layers of a larger model, in which they have further outputs."""
    inputs = keras.Input((3,))
    hidden = keras.layers.Dense(8, "tanh")(inputs)
    values = keras.layers.Dense(5, name="values")(hidden)
    keras.Model(inputs, keras.layers.Dense(8)(values))
    keras.Model(inputs, keras.layers.Dense(8)(hidden))
    return keras.Model(inputs, values)


def _two_outputs(keras: Keras) -> Any:
    inputs = keras.Input((3,))
    hidden = keras.layers.Dense(5, "tanh", name="hidden")(inputs)
    heads = [keras.layers.Dense(5, name=name)(hidden) for name in ("left", "right")]
    return keras.Model(inputs, heads)


def _two_inputs(keras: Keras) -> Any:
    inputs = [keras.Input((size,), name=name) for size, name in ((2, "left"), (1, "right"))]
    both = keras.layers.Concatenate(name="both")(inputs)
    return keras.Model(inputs, keras.layers.Dense(5)(keras.layers.Dense(8, "tanh")(both)))


def _used_twice(keras: Keras, inputs: Any) -> Any:
    shared = keras.layers.Dense(8, "tanh", name="shared")
    return HEAD(keras)(shared(shared(dense(8)(keras)(inputs))))


def _skip(kind: str) -> Callable[[Keras, Any], Any]:
    def connect(keras: Keras, inputs: Any) -> Any:
        hidden = dense(3)(keras)(inputs)
        return HEAD(keras)(layer(kind, name="odd")(keras)([hidden, inputs]))

    return connect


def _sum_of_layers(keras: Keras, inputs: Any) -> Any:
    hidden = dense(8)(keras)(inputs)
    return dense(5, None, name="values")(keras)(dense(8)(keras)(hidden) + hidden)


def _always_dropout(keras: Keras, inputs: Any) -> Any:
    hidden = layer("Dropout", 0.5, name="odd")(keras)(dense(8)(keras)(inputs), training=True)
    return HEAD(keras)(hidden)


def _nested(keras: Keras, inputs: Any) -> Any:
    inner = keras.Sequential(
        [keras.Input((3,)), *(build(keras) for build in (dense(8), dense(8)))], name="odd"
    )
    return HEAD(keras)(inner(inputs))


def _dqn(*hidden_units: int) -> Build:
    def build(keras: Keras) -> Any:
        import keras_pendulum as kp

        return kp.DQN(hidden_units, 5)

    return build


def odd(*layers: Build, order: Order = "untested", **options: Any) -> Network:
    """Returns a Sequential with a layer that is named `odd` and must be refused."""
    return Network(sequential(*layers, HEAD), order, "refused", ("odd",), **options)


CHAINS: dict[str, Network] = {
    "two hidden layers": Network(sequential(dense(16), dense(8), HEAD)),
    "one hidden layer": Network(sequential(dense(16), HEAD)),
    "41 actions": Network(sequential(dense(64), dense(32), dense(41, None))),
    "two actions": Network(sequential(dense(16), dense(8), dense(2, None))),
    "relu": Network(sequential(dense(16, "relu"), dense(8, "relu"), HEAD), activation="relu"),
    "tanh, relu, linear": Network(
        sequential(dense(16), dense(12, "relu"), dense(8, None), HEAD), "untested"
    ),
    "relu, tanh": Network(sequential(dense(8, "relu"), dense(8, "tanh"), HEAD), "untested"),
    "all linear": Network(sequential(dense(16, None), dense(8, None), HEAD), "untested"),
    "three equal widths": Network(sequential(*EQUAL, HEAD), "sequential"),
    "four equal widths": Network(sequential(dense(8), *EQUAL, HEAD), "sequential"),
    "twelve equal widths": Network(sequential(*EQUAL * 4, HEAD), "sequential"),
    "all as wide as the head": Network(sequential(dense(5), dense(5), HEAD), "sequential"),
    "as wide as the observation": Network(sequential(dense(3), dense(3), HEAD), "sequential"),
    "back to the width of the observation": Network(sequential(dense(8), dense(3), HEAD)),
    "h2, h1, h3": Network(sequential(*named("h2", "h1", "h3")), "sequential"),
    "z, y, x, a": Network(sequential(*named("z", "y", "x", "a")), "sequential"),
    "dense_10 before dense_2": Network(
        sequential(*named("dense_10", "dense_2", "dense_1", "dense")), "sequential"
    ),
    "dense_2 before dense_10": Network(
        sequential(*named("dense_2", "dense_10", "dense_1", "dense")), "sequential"
    ),
    "head, hidden, output": Network(sequential(*named("head", "hidden", "output")), "sequential"),
    "layers, vars, optimizer": Network(
        sequential(*named("layers", "vars", "optimizer")), "sequential"
    ),
    "names in other alphabets": Network(
        sequential(*named("größe", "日本", "ελ")), "sequential", versions=(3,)
    ),
    "slashes in names": Network(
        sequential(*named("a/b", "a", "b/a", "b")), "sequential", versions=(2,)
    ),
    "Activation layers of tanh": Network(
        sequential(dense(16, None), activation("tanh"), dense(8, None), activation("tanh"), HEAD)
    ),
    "Activation layers of relu": Network(
        sequential(dense(8, None), activation("relu"), dense(8, None), activation("relu"), HEAD),
        "sequential",
        activation="relu",
    ),
    "Activation layers, mixed": Network(
        sequential(dense(8, None), activation("relu"), dense(8), activation("linear"), HEAD),
        "untested",
    ),
    "linear Activation behind the head": Network(sequential(dense(16), HEAD, activation("linear"))),
    "Dropout": Network(sequential(dense(16), DROPOUT, dense(8), DROPOUT, HEAD)),
    "Dropout of the observation": Network(sequential(DROPOUT, *EQUAL, HEAD), "sequential"),
    "Dropout before Activation": Network(
        sequential(dense(16, None), DROPOUT, activation("relu"), HEAD), activation="relu"
    ),
    "built by its first call": Network(without_input(*EQUAL, HEAD), "sequential"),
    "compiled": Network(compiled(sequential(*EQUAL, HEAD), train=False), "sequential"),
    "trained by Adam": Network(compiled(sequential(*EQUAL, HEAD)), "sequential"),
    "trained by RMSprop": Network(compiled(sequential(dense(16), dense(8), HEAD), "rmsprop")),
    "trained with a metric": Network(
        compiled(functional(*EQUAL, HEAD), metrics=["mae"]), "functional"
    ),
    "a layer that is not trained": Network(
        compiled(sequential(dense(16, trainable=False), dense(8), HEAD))
    ),
    "regularizers and constraints": Network(
        sequential(
            dense(16, kernel_regularizer="l2", bias_constraint="non_neg"),
            dense(8, kernel_initializer="he_uniform", activity_regularizer="l1"),
            HEAD,
        )
    ),
    "functional": Network(functional(dense(16), dense(8), HEAD)),
    "functional of equal widths": Network(functional(*EQUAL, HEAD), "functional"),
    "functional, created backwards": Network(
        functional(*EQUAL, HEAD, created=(3, 2, 1, 0)), "functional"
    ),
    "functional, created in another order": Network(
        functional(*EQUAL, HEAD, created=(1, 3, 0, 2)), "functional"
    ),
    "functional of twelve layers, created backwards": Network(
        functional(*EQUAL * 4, HEAD, created=range(12, -1, -1)), "functional"
    ),
    "functional, h2, h1, h3": Network(functional(*named("h2", "h1", "h3")), "functional"),
    "functional, h2, h1, h3, created backwards": Network(
        functional(*named("h2", "h1", "h3"), created=(2, 1, 0)), "functional"
    ),
    "functional with Activation and Dropout": Network(
        functional(dense(8, None), activation("relu"), DROPOUT, dense(8, "relu"), HEAD),
        "functional",
        activation="relu",
    ),
    "functional, relu, tanh": Network(
        functional(dense(8, "relu"), dense(8), HEAD, created=(2, 1, 0)), "untested"
    ),
    "functional, trained": Network(
        compiled(functional(*EQUAL, HEAD, created=(2, 1, 0, 3))), "functional"
    ),
    "part of another model": Network(part_of_another),
}

# The files of weights alone have the layers in the order in which attributes are assigned or named.
SUBCLASSED: dict[str, Network] = {
    "attributes in the order of calls": Network(
        subclassed({"a": dense(16), "b": dense(8), "c": HEAD}), whole="either"
    ),
    "attributes in another order": Network(
        subclassed({"c": HEAD, "b": dense(8), "a": dense(16)}, "abc"), whole="either"
    ),
    "relu attributes in another order": Network(
        subclassed({"x": dense(8, "relu"), "z": dense(16, "relu"), "y": HEAD}, "zxy"),
        whole="either",
        activation="relu",
    ),
    "equal widths, names before `layers`": Network(
        subclassed({"b": dense(8), "a": dense(8), "c": HEAD}, "abc"), "unknown", "either"
    ),
    "equal widths, names before `layers`, in order": Network(
        subclassed({"a": dense(8), "b": dense(8), "c": HEAD}), "unknown", "either"
    ),
    "equal widths, names behind `layers`": Network(
        subclassed({"y": dense(8), "x": dense(8), "z": HEAD}, "xyz"), "unknown", "either"
    ),
    "equal widths, called against the alphabet": Network(
        subclassed({"y": dense(8), "x": dense(8), "z": HEAD}), "unknown", "either"
    ),
    "equal widths, names before and behind `layers`": Network(
        subclassed({"z": dense(8), "a": dense(8), "y": dense(8), "b": HEAD}, "yazb"),
        "unknown",
        "either",
    ),
    "list of layers": Network(
        subclassed({"hidden": [dense(16), dense(8)], "head": HEAD}), whole="either"
    ),
    "list of equal widths": Network(
        subclassed({"hidden": list(EQUAL), "head": HEAD}), "unknown", "either"
    ),
    "list of equal widths, called backwards": Network(
        subclassed({"hidden": list(EQUAL), "head": HEAD}, backwards=True), "unknown", "either"
    ),
    "list behind `layers`, called backwards": Network(
        subclassed({"stack": list(EQUAL), "value": HEAD}, backwards=True), "unknown", "either"
    ),
    "list of all layers": Network(subclassed({"all": [*EQUAL, HEAD]}), "unknown", "either"),
    "dictionary of equal widths": Network(
        subclassed({"hidden": {"b": dense(8), "a": dense(8)}, "head": HEAD}), "unknown", "either"
    ),
    "weights made by build": Network(
        subclassed({"a": dense(16), "b": dense(8), "c": HEAD}, prebuilt=True), whole="either"
    ),
    "equal widths made by build, called in another order": Network(
        subclassed({"b": dense(8), "a": dense(8), "c": HEAD}, "abc", prebuilt=True),
        "unknown",
        "either",
    ),
    "trained": Network(
        compiled(subclassed({"c": HEAD, "b": dense(8), "a": dense(16)}, "abc")), whole="either"
    ),
    "a Sequential inside": Network(
        subclassed({"net": sequential(dense(16), dense(8), HEAD)}), "unknown", "either"
    ),
    "a Sequential of equal widths inside": Network(
        subclassed({"net": sequential(*EQUAL, HEAD)}), "unknown", "either"
    ),
    "two Sequentials inside, called in another order": Network(
        subclassed(
            {"b": sequential(dense(8), inputs=8), "a": sequential(dense(8)), "head": HEAD},
            ["a", "b", "head"],
        ),
        "unknown",
        "either",
    ),
    "this package's network": Network(_dqn(16, 8), whole="either", versions=(3,)),
    "this package's network of equal widths": Network(
        _dqn(8, 8, 8), "unknown", "either", versions=(3,)
    ),
    "subclass of Sequential": Network(_sequential_subclass, "unknown", "either"),
    "subclass of a functional model": Network(_functional_subclass, "unknown", "either"),
}

OTHERS: dict[str, Network] = {
    "elu": odd(dense(8, "elu", name="odd")),
    "elu Activation": odd(dense(8, None), layer("Activation", "elu", name="odd")),
    "sigmoid behind tanh": odd(dense(8), dense(8, "sigmoid", name="odd")),
    "two activations in a row": odd(dense(8), layer("Activation", "relu", name="odd")),
    "Activation of the observation": odd(layer("Activation", "tanh", name="odd"), dense(8)),
    "own activation": odd(_own_activation),
    "LeakyReLU": odd(dense(8, None), layer("LeakyReLU", name="odd"), order="classes"),
    "LeakyReLU as activation": odd(
        lambda keras: keras.layers.Dense(8, keras.layers.LeakyReLU(), name="odd")
    ),
    "ReLU up to 1": odd(dense(8, None), layer("ReLU", max_value=1.0, name="odd")),
    "Rescaling": odd(layer("Rescaling", 2.0, name="odd"), dense(8), order="classes"),
    "Normalization": odd(layer("Normalization", name="odd"), dense(8), order="arrays"),
    "BatchNormalization": odd(dense(8), layer("BatchNormalization", name="odd"), order="arrays"),
    "no bias": odd(dense(8, use_bias=False, name="odd"), order="arrays"),
    "Lambda": odd(layer("Lambda", _doubled, name="odd"), dense(8), order="classes"),
    "mixed_float16": odd(dense(8, dtype="mixed_float16", name="odd")),
    "own Dense": odd(custom_dense),
    "Conv1D": odd(
        layer("Reshape", (3, 1), name="odd"),
        layer("Conv1D", 4, 2),
        layer("Flatten"),
        order="arrays",
    ),
    "nested Sequential": Network(graph(_nested), "untested", "refused", ("odd",)),
    "tanh head": Network(
        sequential(dense(8), dense(5, "tanh", name="odd")), "untested", "refused", ("odd",)
    ),
    "relu behind the head": Network(
        sequential(dense(8), HEAD, layer("Activation", "relu", name="odd")),
        *("untested", "refused", ("odd",)),
    ),
    "softmax head": Network(
        sequential(dense(8), dense(5, "softmax", name="odd")), "untested", "refused", ("odd",)
    ),
    "Add": Network(graph(_skip("Add")), "classes", "refused", ("odd",)),
    "Concatenate": Network(graph(_skip("Concatenate")), "classes", "refused", ("odd",)),
    "sum of two layers": Network(
        graph(_sum_of_layers), "untested", "refused", ("add", "tf.__operators__.add")
    ),
    "a layer used twice": Network(graph(_used_twice), "untested", "refused", ("shared",)),
    "Dropout that is always on": Network(graph(_always_dropout), "untested", "refused", ("odd",)),
    "two outputs": Network(_two_outputs, "untested", "refused", ("left", "right", "hidden")),
    "two inputs": Network(_two_inputs, "classes", "refused", ("both", "left", "right")),
    # Chains of layers that `load_weights` may know or refuse.
    "Flatten": Network(sequential(layer("Flatten"), dense(16), HEAD), whole="either"),
    "ReLU": Network(
        sequential(dense(16, None), layer("ReLU"), HEAD), "unknown", "either", activation="relu"
    ),
    "GaussianNoise": Network(
        sequential(layer("GaussianNoise", 0.1), dense(16), HEAD), "unknown", "either"
    ),
    "float64": Network(sequential(dense(16, dtype="float64"), HEAD), "unknown", "either"),
    "no hidden layer": Network(sequential(HEAD), "unknown", "either"),
    "one action": Network(sequential(dense(8), dense(1, None)), "unknown", "either"),
    "four inputs, two actions": Network(
        sequential(dense(8), dense(2, None), inputs=4), "unknown", "either", inputs=4
    ),
}
NETWORKS = {**CHAINS, **SUBCLASSED, **OTHERS}
