using System;
using UnityEngine;

namespace Nep.Unity
{
    /// <summary>NEP node that exists while this component is enabled and runs callbacks in the main thread.</summary>
    /// <remarks>
    /// Create publishers and subscriptions in <c>Start</c> of other components, with <see cref="Node"/>. Subscriptions with
    /// <see cref="CallbackMode.Update"/> are called in <c>Update</c>.
    /// </remarks>
    [DefaultExecutionOrder(-100)]
    [AddComponentMenu("NEP/NEP Connection")]
    public sealed class NepConnection : MonoBehaviour
    {
        [Tooltip("Name in the graph. Empty: the name of the game object.")]
        [SerializeField] private string nodeName = "";

        [Tooltip("Address of the master, HOST or HOST:PORT. Empty: this computer.")]
        [SerializeField] private string master = "";

        [Tooltip("Maximum time for callbacks per frame, in milliseconds.")]
        [SerializeField] private float budgetMilliseconds = 4.0f;

        private Node _node;

        /// <summary>Node of this component, created on first access.</summary>
        /// <exception cref="InvalidOperationException">The component is disabled.</exception>
        public Node Node
        {
            get
            {
                if (_node == null)
                {
                    if (!isActiveAndEnabled)
                    {
                        throw new InvalidOperationException("The NEP connection is disabled.");
                    }
                    string shown = string.IsNullOrEmpty(nodeName) ? gameObject.name : nodeName;
                    _node = new Node(shown, new NodeOptions { Master = master, CloseTimeout = TimeSpan.FromSeconds(0.5) });
                    _node.CallbackFailed += OnCallbackFailed;
                }
                return _node;
            }
        }

        private void Update()
        {
            if (_node != null)
            {
                _node.Update(TimeSpan.FromMilliseconds(budgetMilliseconds));
            }
        }

        private void OnDisable()
        {
            if (_node != null)
            {
                _node.Close();
                _node = null;
            }
        }

        private static void OnCallbackFailed(object sender, UnhandledExceptionEventArgs arguments)
        {
            Debug.LogException((Exception)arguments.ExceptionObject);
        }
    }
}
